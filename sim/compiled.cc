// Drives one compiled design through the CXXRTL C API: feeds blocks, takes steps, records.
//
// The design's ports have the plain names of discreta.hdl.plain. Nothing here knows the method: the
// fields of a block, the fields of a step and the watched signals are lists of port names.

#include <cxxrtl/capi/cxxrtl_capi.h>
#include <cstdint>
#include <cstdlib>
#include <vector>

extern "C" cxxrtl_toplevel cxxrtl_design_create();

namespace {

struct Port {
	uint32_t *curr = nullptr;
	uint32_t *next = nullptr;
	unsigned width = 0;
	bool is_signed = false;

	// A port that the design does not have is 0, and nothing is done by setting it.
	int64_t get() const {
		if (curr == nullptr)
			return 0;
		uint64_t value = curr[0];
		if (width > 32)
			value |= uint64_t(curr[1]) << 32;
		if (is_signed && (value >> (width - 1)) & 1)
			value |= ~uint64_t(0) << (width - 1);
		return int64_t(value);
	}

	void set(int64_t value) {
		if (next == nullptr)
			return;
		uint64_t bits = uint64_t(value);
		if (width < 64)
			bits &= (uint64_t(1) << width) - 1;
		next[0] = uint32_t(bits);
		if (width > 32)
			next[1] = uint32_t(bits >> 32);
	}
};

// SplitMix64 of (seed, clock, channel): the same function stands in discreta.sim.stalls.
uint64_t draw(uint64_t seed, uint64_t clock, uint64_t channel) {
	uint64_t z = seed + (2 * clock + channel + 1) * UINT64_C(0x9E3779B97F4A7C15);
	z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
	z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
	return (z ^ (z >> 31)) >> 32;
}

struct Bench {
	cxxrtl_handle design;
	Port clk, rst, blocks_valid, blocks_ready, steps_valid, steps_ready, done, error, busy, reason;
	std::vector<Port> block_fields, step_fields, watched, controls;
	std::vector<int64_t> pins; // what the step fields were a clock ago
	uint64_t clock = 0;
	bool offering = false;

	// A clock is evaluated once, at its rising edge: until the new values of the registers are
	// committed all that can be seen is what it is before the edge.
	void settle() {
		clk.set(0);
		cxxrtl_commit(design);
		clk.set(1);
		cxxrtl_eval(design);
	}

	void edge() {
		cxxrtl_commit(design);
	}

	void reset() {
		blocks_valid.set(0);
		steps_ready.set(0);
		rst.set(1);
		settle();
		edge();
		rst.set(0);
		clock = 0;
		offering = false;
		pins.clear();
	}

	// Whether a pin has changed since the clock before.
	bool pins_changed() {
		bool changed = false, first = pins.empty();
		pins.resize(step_fields.size());
		for (size_t k = 0; k < step_fields.size(); k++) {
			int64_t level = step_fields[k].get();
			changed |= !first && level != pins[k];
			pins[k] = level;
		}
		return changed;
	}
};

bool find(Bench *bench, const char *name, Port *port) {
	cxxrtl_object *object = cxxrtl_get(bench->design, name);
	if (object == nullptr || object->width > 64)
		return false;
	// What is kept until a commit but is not a register would be a clock old.
	const uint32_t kept = CXXRTL_DRIVEN_COMB | CXXRTL_DRIVEN_SYNC;
	const bool fresh = object->next != nullptr && (object->flags & kept) == CXXRTL_DRIVEN_COMB;
	port->curr = fresh ? object->next : object->curr;
	port->next = object->next;
	port->width = unsigned(object->width);
	return true;
}

} // namespace

extern "C" {

struct Request {
	uint64_t clocks;         // run this many clocks at most
	uint64_t until_answered; // stop when this many blocks are done or rejected; 0: run all clocks
	const int64_t *blocks;   // [block_count][block fields]
	uint64_t block_count;
	uint64_t seed;
	uint64_t stall_below;    // the step is not taken when draw(seed, clock, 0) < stall_below
	uint64_t gap_below;      // no new block is offered when draw(seed, clock, 1) < gap_below
	int64_t *events;         // [event_room][5 + step fields]; nullptr: none recorded
	uint64_t event_room;
	int64_t *watch;          // [clocks][watched]; nullptr: none recorded
	const int64_t *orders;   // [order_count][3]: from which clock on, which control, its value
	uint64_t order_count;
	uint64_t until_idle;     // stop when nothing is busy and all blocks are fed, or none is taken
	// answers
	uint64_t ran;
	uint64_t fed;
	uint64_t answered;
	uint64_t event_count;
	uint64_t ordered;
	uint64_t idle;
};

void *bench_create() {
	Bench *bench = new Bench;
	bench->design = cxxrtl_create(cxxrtl_design_create());
	bool ok = find(bench, "clk", &bench->clk) && find(bench, "rst", &bench->rst) &&
		find(bench, "blocks_valid", &bench->blocks_valid) &&
		find(bench, "blocks_ready", &bench->blocks_ready) &&
		find(bench, "done", &bench->done);
	// Of an interpolator the steps, of a device the pins are followed.
	bool steps = find(bench, "steps_valid", &bench->steps_valid) &&
		find(bench, "steps_ready", &bench->steps_ready) && find(bench, "error", &bench->error);
	bool device = find(bench, "busy", &bench->busy) && find(bench, "reason", &bench->reason);
	// Of a design with loops of wires one evaluation would not do.
	if (!ok || steps == device || !cxxrtl_eval(bench->design)) {
		cxxrtl_destroy(bench->design);
		delete bench;
		return nullptr;
	}
	return bench;
}

void bench_destroy(void *handle) {
	Bench *bench = static_cast<Bench *>(handle);
	cxxrtl_destroy(bench->design);
	delete bench;
}

// kind: 0 field of a block, 1 field of a step, 2 watched, 3 control. Answers 0 when there is no such port.
int bench_add(void *handle, int kind, const char *name, int is_signed) {
	Bench *bench = static_cast<Bench *>(handle);
	Port port;
	if (!find(bench, name, &port))
		return 0;
	port.is_signed = is_signed != 0;
	std::vector<Port> *lists[] = {
		&bench->block_fields, &bench->step_fields, &bench->watched, &bench->controls};
	lists[kind]->push_back(port);
	return 1;
}

void bench_reset(void *handle) {
	static_cast<Bench *>(handle)->reset();
}

void bench_run(void *handle, Request *request) {
	Bench &bench = *static_cast<Bench *>(handle);
	Request &r = *request;
	const size_t fields = bench.block_fields.size();
	const bool device = bench.steps_valid.curr == nullptr;
	r.ran = r.fed = r.answered = r.event_count = r.ordered = r.idle = 0;
	int64_t *watch = r.watch;
	int64_t *event = r.events;
	while (r.ran < r.clocks && (r.events == nullptr || r.event_count < r.event_room)) {
		if (r.until_answered && r.answered >= r.until_answered)
			break;
		for (; r.ordered < r.order_count; r.ordered++) {
			const int64_t *order = r.orders + 3 * r.ordered;
			if (uint64_t(order[0]) > bench.clock)
				break;
			bench.controls[order[1]].set(order[2]);
		}
		if (!bench.offering && r.fed < r.block_count &&
				(!r.gap_below || draw(r.seed, bench.clock, 1) >= r.gap_below)) {
			for (size_t k = 0; k < fields; k++)
				bench.block_fields[k].set(r.blocks[r.fed * fields + k]);
			bench.offering = true;
		}
		bool ready = !r.stall_below || draw(r.seed, bench.clock, 0) >= r.stall_below;
		bench.blocks_valid.set(bench.offering);
		bench.steps_ready.set(ready);
		bench.settle();

		bool accepted = bench.offering && bench.blocks_ready.get();
		bool taken = device ? bench.pins_changed() : ready && bench.steps_valid.get();
		int64_t done = bench.done.get(), error = bench.error.get();
		if (event != nullptr && (accepted || taken || done || error)) {
			*event++ = int64_t(bench.clock);
			*event++ = accepted;
			*event++ = done;
			*event++ = error;
			*event++ = taken;
			for (const Port &port : bench.step_fields)
				*event++ = port.get();
			r.event_count++;
		}
		if (watch != nullptr)
			for (const Port &port : bench.watched)
				*watch++ = port.get();
		if (accepted) {
			bench.offering = false;
			r.fed++;
		}
		r.answered += (done != 0) + (error != 0);
		bool fed = r.fed == r.block_count && !accepted;
		r.idle = !bench.busy.get() && (fed || bench.reason.get());
		bench.edge();
		bench.clock++;
		r.ran++;
		if (r.until_idle && r.idle)
			break;
	}
}

} // extern "C"
