/* From a function's instructions to a tape: shared values once, products joined with their sums, registers assigned.
 *
 * 1. Each instruction makes a value. Two that apply the same operation to the same values are one (value numbering;
 *    Cocke and Schwartz 1970). Values that nothing uses are left out.
 * 2. A product that only one sum or difference uses becomes one instruction with it. Both are still rounded.
 * 3. Within a window, values come in an order with long runs of one operation: the processor then foresees each jump.
 *    This makes a run three to four times as fast.
 * 4. A value takes the register that was left last, from its instruction to its last use.
 *
 * No value changes by a bit; only which of two NaN, and so the sign of a NaN, comes out of an operation is not said. */
#include "tape.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
  int32_t operation, first, second, third; /* values; CONST: the halves of the number; INPUT: argument and nonzero */
  int32_t uses;                            /* how many read it; OUTPUT: 1, and `third` is which of the outputs */
  int32_t last;                            /* the place of the one that reads it last */
  int32_t place;                           /* the register */
  int32_t missing;                         /* how many operands are not in order yet */
  int32_t readers;                         /* the first of `edges` to a value that waits for this one; -1 is none */
  int32_t next;                            /* the value behind this one in a queue; -1 is none */
} value;

typedef struct {
  int32_t reader, next;
} edge;

/* What is known while a tape is made. */
typedef struct {
  value *values;
  int32_t *latest;   /* the value in each register of the function; -1 is none */
  int32_t *table;    /* of values, by what they are: open addressing; -1 is empty */
  int32_t *released; /* registers of the tape that are free */
  int32_t *order;    /* values in the order of the instructions */
  edge *edges;
  int64_t count, room, mask, registers, free, ordered;
} making;

/* How many values are put in order together: long enough for long runs, short enough to need few more registers. */
enum { WINDOW = 65536 };

#define NAME(name) #name,
static const char *const names[] = {MT_TAPE_OPERATIONS(NAME)};
#define NAMES ((int)(sizeof names / sizeof *names))

const char *mt_tape_operation(int index) {
  return index >= 0 && index < NAMES ? names[index] : NULL;
}

static int operands(int operation) {
  switch (operation) {
    case MT_TAPE_CONST:
    case MT_TAPE_INPUT:
      return 0;
    case MT_TAPE_ADD:
    case MT_TAPE_SUB:
    case MT_TAPE_MUL:
    case MT_TAPE_DIV:
    case MT_TAPE_COPYSIGN:
    case MT_TAPE_IF_ELSE_ZERO:
    case MT_TAPE_AND:
    case MT_TAPE_OR:
    case MT_TAPE_LT:
    case MT_TAPE_LE:
    case MT_TAPE_EQ:
    case MT_TAPE_NE:
    case MT_TAPE_FMIN:
    case MT_TAPE_FMAX:
    case MT_TAPE_FMOD:
    case MT_TAPE_REMAINDER:
    case MT_TAPE_POW:
    case MT_TAPE_CONSTPOW:
    case MT_TAPE_HYPOT:
    case MT_TAPE_ATAN2:
      return 2;
    case MT_TAPE_MULTIPLY_ADD:
    case MT_TAPE_MULTIPLY_SUBTRACT:
    case MT_TAPE_SUBTRACT_PRODUCT:
      return 3;
    default:
      return 1;
  }
}

static uint64_t mixed(int32_t operation, int32_t first, int32_t second) {
  uint64_t key = ((uint64_t)(uint32_t)first << 32 | (uint32_t)second) + (uint64_t)operation * 0x9E3779B97F4A7C15u;
  key = (key ^ key >> 30) * 0xBF58476D1CE4E5B9u; /* splitmix64; Steele, Lea and Flood 2014 */
  key = (key ^ key >> 27) * 0x94D049BB133111EBu;
  return key ^ key >> 31;
}

/* Return the value of an operation, which may be there already. */
static int32_t numbered(making *m, int32_t operation, int32_t first, int32_t second) {
  if ((operation == MT_TAPE_ADD || operation == MT_TAPE_MUL) && first > second) {
    const int32_t other = first;
    first = second;
    second = other;
  }
  if (operation == MT_TAPE_MUL && first == second) operation = MT_TAPE_SQ;
  if (operation == MT_TAPE_ADD && first == second) operation = MT_TAPE_TWICE;
  if (operands(operation) == 1) second = 0;
  int64_t slot = (int64_t)(mixed(operation, first, second) & (uint64_t)m->mask);
  for (; m->table[slot] >= 0; slot = (slot + 1) & m->mask) {
    const value *known = &m->values[m->table[slot]];
    if (known->operation == operation && known->first == first && known->second == second) return m->table[slot];
  }
  m->values[m->count] = (value){.operation = operation, .first = first, .second = second, .last = -1, .place = -1};
  m->table[slot] = (int32_t)m->count;
  return (int32_t)m->count++;
}

/* Read all instructions; return 0 where one makes no sense. */
static int read_all(making *m, int64_t count, const int32_t *read, int64_t arguments, int64_t outputs) {
  for (int64_t k = 0; k < count; k++) {
    const int32_t operation = read[4 * k], i0 = read[4 * k + 1], i1 = read[4 * k + 2], i2 = read[4 * k + 3];
    if (operation < 0 || operation >= NAMES || i0 < 0 || i0 >= m->room) return 0;
    int32_t first = i1, second = i2;
    if (operation == MT_TAPE_INPUT && (i1 < 0 || i1 >= arguments || i2 < 0)) return 0;
    if (operation == MT_TAPE_OUTPUT && (i0 != 0 || i2 < 0 || i2 >= outputs)) return 0;
    const int taken = operands(operation);
    if (taken > 0 && (i1 < 0 || i1 >= m->room || (first = m->latest[i1]) < 0)) return 0;
    if (taken > 1 && (i2 < 0 || i2 >= m->room || (second = m->latest[i2]) < 0)) return 0;
    if (operation == MT_TAPE_OUTPUT) {
      m->values[m->count++] = (value){.operation = operation, .first = first, .third = i2, .uses = 1};
    } else {
      const int same = operation == MT_TAPE_ASSIGN || operation == MT_TAPE_LIFT;
      m->latest[i0] = same ? first : numbered(m, operation, first, second);
    }
  }
  return 1;
}

/* Count how often each value is read, from the outputs back; what only unread values read is unread. */
static void count_uses(making *m) {
  for (int64_t k = m->count - 1; k >= 0; k--) {
    const value *v = &m->values[k];
    const int taken = v->uses ? operands(v->operation) : 0;
    if (taken > 0) m->values[v->first].uses++;
    if (taken > 1) m->values[v->second].uses++;
  }
}

/* Make a product, and the sum or difference that alone reads it, one value. */
static void join_products(making *m) {
  for (int64_t k = 0; k < m->count; k++) {
    value *v = &m->values[k];
    if (!v->uses || (v->operation != MT_TAPE_ADD && v->operation != MT_TAPE_SUB)) continue;
    value *first = &m->values[v->first], *second = &m->values[v->second], *product;
    if (second->operation == MT_TAPE_MUL && second->uses == 1) {
      v->operation = v->operation == MT_TAPE_ADD ? MT_TAPE_MULTIPLY_ADD : MT_TAPE_SUBTRACT_PRODUCT;
      v->third = v->first;
      product = second;
    } else if (first->operation == MT_TAPE_MUL && first->uses == 1) {
      v->operation = v->operation == MT_TAPE_ADD ? MT_TAPE_MULTIPLY_ADD : MT_TAPE_MULTIPLY_SUBTRACT;
      v->third = v->second;
      product = first;
    } else {
      continue;
    }
    v->first = product->first;
    v->second = product->second;
    product->uses = 0;
  }
}

/* Return the values that a value reads. */
static int operands_of(const value *v, int32_t read[3]) {
  const int taken = operands(v->operation);
  if (taken > 0) read[0] = v->first;
  if (taken > 1) read[1] = v->second;
  if (taken > 2) read[2] = v->third;
  return taken;
}

/* Put the values [from, to) in an order with long runs of one operation.
 *
 * Of those whose operands are there, all of the commonest operation come next, until none is left. */
static void order_window(making *m, int64_t from, int64_t to) {
  int32_t read[3], edges = 0, ready[MT_TAPE_KINDS], heads[MT_TAPE_KINDS], tails[MT_TAPE_KINDS];
  memset(ready, 0, sizeof ready);
  for (int64_t k = from; k < to; k++) {
    value *v = &m->values[k];
    v->readers = v->next = -1;
    if (!v->uses) continue;
    v->missing = 0;
    for (int i = operands_of(v, read); i-- > 0;) {
      if (read[i] < from) continue;
      m->edges[edges] = (edge){(int32_t)k, m->values[read[i]].readers};
      m->values[read[i]].readers = edges++;
      v->missing++;
    }
  }
#define ENQUEUE(index)                                      \
  {                                                         \
    const int kind = m->values[index].operation;            \
    if (ready[kind]++) m->values[tails[kind]].next = index; \
    else heads[kind] = index;                               \
    tails[kind] = index;                                    \
  }
  for (int64_t k = from; k < to; k++) {
    if (m->values[k].uses && !m->values[k].missing) ENQUEUE((int32_t)k)
  }
  for (;;) {
    int commonest = 0;
    for (int kind = 1; kind < MT_TAPE_KINDS; kind++) {
      if (ready[kind] > ready[commonest]) commonest = kind;
    }
    if (!ready[commonest]) return;
    for (; ready[commonest]; ready[commonest]--) {
      const int32_t k = heads[commonest];
      m->order[m->ordered++] = k;
      for (int32_t e = m->values[k].readers; e >= 0; e = m->edges[e].next) {
        if (--m->values[m->edges[e].reader].missing == 0) ENQUEUE(m->edges[e].reader)
      }
      heads[commonest] = m->values[k].next;
    }
  }
}

static void order_all(making *m) {
  for (int64_t k = 0; k < m->count; k += WINDOW) {
    order_window(m, k, k + WINDOW < m->count ? k + WINDOW : m->count);
  }
}

static void find_last_uses(making *m) {
  int32_t read[3];
  for (int64_t at = 0; at < m->ordered; at++) {
    for (int i = operands_of(&m->values[m->order[at]], read); i-- > 0;) m->values[read[i]].last = (int32_t)at;
  }
}

/* Write the instructions; return 0 where there are more registers than an instruction can name. */
static int write_all(making *m, mt_tape *tape) {
  int32_t constants = 0, read[3], registers[3];
  for (int64_t at = 0; at < m->ordered; at++) {
    value *v = &m->values[m->order[at]];
    mt_instruction made = {.operation = (uint16_t)v->operation, .first = v->first, .second = v->second};
    if (v->operation == MT_TAPE_CONST) {
      const int32_t halves[2] = {v->first, v->second};
      memcpy(&tape->constants[constants], halves, sizeof halves);
      made.first = constants++;
    }
    const int taken = operands_of(v, read);
    for (int i = 0; i < taken; i++) registers[i] = m->values[read[i]].place;
    for (int i = 0; i < taken; i++) {
      value *operand = &m->values[read[i]];
      if (operand->last != at) continue;
      operand->last = -1; /* read twice, it is released once */
      m->released[m->free++] = operand->place;
    }
    if (taken > 0) made.first = made.second = registers[0];
    if (taken > 1) made.second = registers[1];
    if (taken > 2) made.third = (uint16_t)registers[2];
    if (v->operation == MT_TAPE_OUTPUT) {
      made.out = v->third;
    } else {
      v->place = m->free ? m->released[--m->free] : (int32_t)m->registers++;
      if (m->registers > UINT16_MAX) return 0;
      made.out = v->place;
    }
    tape->instructions[tape->count++] = made;
  }
  tape->instructions[tape->count++] = (mt_instruction){.operation = MT_TAPE_END};
  tape->registers = m->registers;
  return 1;
}

mt_tape *mt_tape_new(int64_t count, const int32_t *read, int64_t arguments, int64_t outputs) {
  if (count < 0 || count > INT32_MAX / 4 || outputs < 0 || outputs > INT32_MAX) return NULL;
  making m = {.room = 1, .mask = 1};
  int64_t constants = 0;
  for (int64_t k = 0; k < count; k++) {
    if (read[4 * k] != MT_TAPE_OUTPUT && read[4 * k + 1] >= m.room) m.room = (int64_t)read[4 * k + 1] + 1;
    constants += read[4 * k] == MT_TAPE_CONST;
  }
  if (m.room > count + 1) return NULL;
  while (m.mask < 2 * count) m.mask = 2 * m.mask + 1;
  mt_tape *tape = calloc(1, sizeof *tape);
  if (tape) {
    tape->arguments = arguments;
    tape->outputs = outputs;
    tape->instructions = malloc((size_t)(count + 1) * sizeof *tape->instructions);
    tape->constants = malloc((size_t)(constants + 1) * sizeof *tape->constants);
  }
  m.values = malloc((size_t)(count + 1) * sizeof *m.values);
  m.released = malloc((size_t)(count + 1) * sizeof *m.released);
  m.order = malloc((size_t)(count + 1) * sizeof *m.order);
  m.edges = malloc((size_t)(3 * WINDOW) * sizeof *m.edges);
  m.latest = malloc((size_t)m.room * sizeof *m.latest);
  m.table = malloc((size_t)(m.mask + 1) * sizeof *m.table);
  int made = tape && tape->instructions && tape->constants && m.values && m.released && m.order && m.edges && m.latest && m.table;
  if (made) {
    memset(m.latest, -1, (size_t)m.room * sizeof *m.latest);
    memset(m.table, -1, (size_t)(m.mask + 1) * sizeof *m.table);
    made = read_all(&m, count, read, arguments, outputs);
  }
  if (made) {
    count_uses(&m);
    join_products(&m);
    order_all(&m);
    find_last_uses(&m);
    made = write_all(&m, tape);
  }
  free(m.values);
  free(m.released);
  free(m.order);
  free(m.edges);
  free(m.latest);
  free(m.table);
  if (made) return tape;
  mt_tape_delete(tape);
  return NULL;
}

void mt_tape_delete(mt_tape *tape) {
  if (!tape) return;
  free(tape->instructions);
  free(tape->constants);
  free(tape);
}

int64_t mt_tape_count(const mt_tape *tape) {
  return tape->count;
}

int64_t mt_tape_registers(const mt_tape *tape) {
  return tape->registers;
}
