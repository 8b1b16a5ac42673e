// Drives one compiled controller through the CXXRTL C API: a serial line in and out, pins recorded.
//
// The design's ports have the plain names of discreta.hdl.plain. The line is driven and listened to
// by bits, as a serial port does it, with a length of a bit of its own.

#include <cxxrtl/capi/cxxrtl_capi.h>
#include <cstdint>
#include <deque>
#include <vector>

extern "C" cxxrtl_toplevel cxxrtl_design_create();

namespace {

struct Port {
	uint32_t *curr = nullptr;
	uint32_t *next = nullptr;
};

bool find(cxxrtl_handle design, const char *name, Port *port) {
	cxxrtl_object *object = cxxrtl_get(design, name);
	if (object == nullptr || object->width > 32)
		return false;
	// What is kept until a commit but is not a register would be a clock old.
	const uint32_t kept = CXXRTL_DRIVEN_COMB | CXXRTL_DRIVEN_SYNC;
	const bool fresh = object->next != nullptr && (object->flags & kept) == CXXRTL_DRIVEN_COMB;
	port->curr = fresh ? object->next : object->curr;
	port->next = object->next;
	return true;
}

// Slots of a byte: start bit, eight data bits, stop bit.
const int SLOTS = 10;

struct Board {
	cxxrtl_handle design;
	Port clk, rst, rx, tx;
	std::vector<Port> pins, switches;
	std::vector<uint32_t> levels; // of the pins a clock ago
	uint64_t clock = 0;
	uint64_t bit = 0; // length of a bit on the line, in 1/256 clocks
	// What is sent to the board: bytes that wait, the one on the line, when its bits end.
	std::deque<uint8_t> waiting;
	int sent = SLOTS;
	unsigned byte = 0;
	uint64_t sent_until = 0;
	// What the board sends: the next slot to look at, and when.
	int seen = -1;
	unsigned heard = 0;
	uint64_t look = 0;

	// A clock is evaluated once, at its rising edge: until the new values of the registers are
	// committed all that can be seen is what it is before the edge.
	void settle() {
		clk.next[0] = 0;
		cxxrtl_commit(design);
		clk.next[0] = 1;
		cxxrtl_eval(design);
	}

	void edge() {
		cxxrtl_commit(design);
	}

	void reset() {
		rx.next[0] = 1;
		rst.next[0] = 1;
		settle();
		edge();
		rst.next[0] = 0;
	}

	// Puts this clock's level on the line to the board.
	void drive() {
		uint64_t now = clock << 8;
		if (now < sent_until)
			return;
		bool idle = sent == SLOTS;
		if (!idle)
			sent++;
		if (sent == SLOTS) {
			if (waiting.empty())
				return;
			byte = (unsigned(waiting.front()) << 1) | 1u << (SLOTS - 1);
			waiting.pop_front();
			sent = 0;
			if (idle)
				sent_until = now;
		}
		rx.next[0] = byte >> sent & 1;
		sent_until += bit;
	}

	// Looks at the line from the board; answers whether a byte is complete.
	bool listen() {
		uint64_t now = clock << 8;
		unsigned level = tx.curr[0];
		if (seen < 0) {
			if (!level) {
				seen = 0;
				look = now + bit / 2;
			}
			return false;
		}
		if (now < look)
			return false;
		look += bit;
		heard = (seen ? heard : 0) | level << seen;
		seen++;
		if (seen < SLOTS)
			return false;
		seen = -1;
		return heard >> (SLOTS - 1) & 1;
	}
};

} // namespace

extern "C" {

struct Request {
	uint64_t clocks;      // run this many clocks at most
	uint64_t until_heard; // stop when so many bytes have come; 0: do not stop
	const uint8_t *bytes; // put behind those that wait
	uint64_t byte_count;
	uint8_t *heard;       // [heard_room]
	uint64_t heard_room;
	int64_t *events;      // [event_room][1 + pins]: the clock, and the pins from then on
	uint64_t event_room;
	// answers
	uint64_t heard_count;
	uint64_t event_count;
	uint64_t clock;       // since reset
	uint64_t waiting;     // bytes that are not on the line yet
};

void *board_create(uint64_t bit) {
	Board *board = new Board;
	board->bit = bit;
	board->design = cxxrtl_create(cxxrtl_design_create());
	bool ok = find(board->design, "clk", &board->clk) && find(board->design, "rst", &board->rst) &&
		find(board->design, "rx", &board->rx) && find(board->design, "tx", &board->tx);
	if (!ok) {
		cxxrtl_destroy(board->design);
		delete board;
		return nullptr;
	}
	board->reset();
	return board;
}

void board_destroy(void *handle) {
	Board *board = static_cast<Board *>(handle);
	cxxrtl_destroy(board->design);
	delete board;
}

// kind: 0 a pin that is recorded, 1 a switch. Answers 0 when there is no such port.
int board_add(void *handle, int kind, const char *name) {
	Board *board = static_cast<Board *>(handle);
	Port port;
	if (!find(board->design, name, &port))
		return 0;
	(kind ? board->switches : board->pins).push_back(port);
	return 1;
}

void board_switch(void *handle, int index, unsigned level) {
	static_cast<Board *>(handle)->switches[index].next[0] = level;
}

void board_run(void *handle, Request *request) {
	Board &board = *static_cast<Board *>(handle);
	Request &r = *request;
	const size_t pins = board.pins.size();
	board.waiting.insert(board.waiting.end(), r.bytes, r.bytes + r.byte_count);
	r.heard_count = r.event_count = 0;
	int64_t *event = r.events;
	uint64_t end = board.clock + r.clocks;
	while (board.clock < end && r.event_count < r.event_room && r.heard_count < r.heard_room) {
		if (r.until_heard && r.heard_count >= r.until_heard)
			break;
		board.drive();
		board.settle();
		bool changed = board.levels.size() != pins;
		board.levels.resize(pins);
		for (size_t k = 0; k < pins; k++) {
			uint32_t level = board.pins[k].curr[0];
			changed |= level != board.levels[k];
			board.levels[k] = level;
		}
		if (changed) {
			*event++ = int64_t(board.clock);
			for (uint32_t level : board.levels)
				*event++ = level;
			r.event_count++;
		}
		if (board.listen())
			r.heard[r.heard_count++] = uint8_t(board.heard >> 1);
		board.edge();
		board.clock++;
	}
	r.clock = board.clock;
	r.waiting = board.waiting.size();
}

} // extern "C"
