// Judges the steps of exact arcs as they come. See discreta.sim.arc_judge, which names the same fields.

#include <cstdint>

namespace {

// Seen from the centre, in steps; `off` is X² + Y² less that of the start.
struct Point {
	int64_t x, y, off;
};

struct Arc {
	int64_t end_x, end_y;
	int64_t side;    // +1 counter-clockwise, −1 clockwise
	int64_t empty;   // of no length
	Point here;
	Point outside, inside; // the farthest points so far, the first of several; ends are left out
	Point back;      // where the first step back led
	int64_t backward; // whether there was one
	int64_t steps;
	int64_t reached;
};

// What the bench records: clock, accepted, done, error, taken, then the step.
enum { DONE = 2, ERROR = 3, TAKEN = 4, X = 5, Y = 6, LAST = 7, COLUMNS = 8 };

} // namespace

extern "C" uint64_t judge(Arc *arcs, uint64_t count, uint64_t answered, const int64_t *event, uint64_t events) {
	for (; events--; event += COLUMNS) {
		if (event[DONE] | event[ERROR]) {
			if (answered < count && !arcs[answered].steps)
				arcs[answered].reached = event[DONE] && arcs[answered].empty;
			answered++;
		}
		if (!event[TAKEN])
			continue;
		Arc &arc = arcs[answered < count ? answered : count - 1];
		Point &p = arc.here;
		const int64_t u = event[X], v = event[Y];
		const bool backward = arc.side * (p.x * v - p.y * u) < 0;
		p.off += u * (2 * p.x + u) + v * (2 * p.y + v);
		p.x += u;
		p.y += v;
		arc.steps++;
		if (backward && !arc.backward) {
			arc.backward = 1;
			arc.back = p;
		}
		const bool end = p.x == arc.end_x && p.y == arc.end_y;
		if (!end && p.off > arc.outside.off)
			arc.outside = p;
		if (!end && p.off < arc.inside.off)
			arc.inside = p;
		if (event[LAST])
			arc.reached = end && !arc.empty;
	}
	return answered;
}
