/* All tapes of a horizon, shared by threads, and their values put where they belong.
 *
 * A block is a run of one tape for `width` intervals; its values lie as (outputs, width). Threads take blocks as they
 * come. Then each computes a share of the numbers of the results: the first value of each, plus the sum of the others in
 * the order that they were given. So a result does not depend on the number of threads. */
#include "tape_horizon.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "parallel.h"
#include "tape_kernel.h"

/* Work of less than this is not shared: waking a thread takes some microseconds. [instructions of a block, numbers] */
enum { WORTH_SHARING = 20000, ALIGNMENT = 64 };

typedef struct {
  const mt_tape *tape;
  int64_t repeats, arguments, outputs;
  int32_t *sources; /* (arguments) */
  int64_t *offsets; /* (arguments, repeats) */
  int64_t logical;  /* where its values begin, as the caller counts them */
  int64_t physical; /* where they begin in memory */
} part;

typedef struct {
  int64_t size, more;
  int32_t *first, *targets, *terms; /* places in memory; -1 in `first` is zero */
  unsigned char *needs;             /* (parts) */
} result;

typedef struct {
  void *memory;
  double *values, *registers; /* registers: (threads, registers) */
  int threads;
} scratch;

struct mt_horizon {
  part *parts;
  result *results;
  int64_t part_count, result_count;
  int64_t logical, physical;   /* how many values there are, with and without gaps */
  int64_t registers, pointers; /* the most that a block needs */
  int width;
  _Atomic(scratch *) kept; /* of the last run, for the next */
};

static int64_t blocks_of(const mt_horizon *horizon, const part *some) {
  return (some->repeats + horizon->width - 1) / horizon->width;
}

mt_horizon *mt_horizon_new(int64_t results) {
  mt_horizon *horizon = calloc(1, sizeof *horizon);
  if (!horizon) return NULL;
  horizon->results = calloc((size_t)results + 1, sizeof *horizon->results);
  horizon->result_count = results;
  horizon->width = MT_CHOOSE(mt_tape_width)();
  if (horizon->results) return horizon;
  free(horizon);
  return NULL;
}

static void delete_scratch(scratch *some) {
  if (some) free(some->memory);
  free(some);
}

void mt_horizon_delete(mt_horizon *horizon) {
  if (!horizon) return;
  for (int64_t p = 0; p < horizon->part_count; p++) {
    free(horizon->parts[p].sources);
    free(horizon->parts[p].offsets);
  }
  for (int64_t r = 0; r < horizon->result_count; r++) {
    free(horizon->results[r].first);
    free(horizon->results[r].targets);
    free(horizon->results[r].terms);
    free(horizon->results[r].needs);
  }
  delete_scratch(atomic_load(&horizon->kept));
  free(horizon->parts);
  free(horizon->results);
  free(horizon);
}

int mt_horizon_add(mt_horizon *horizon, const mt_tape *tape, int64_t repeats, int64_t arguments, const int32_t *sources,
                   const int64_t *offsets, int64_t outputs) {
  part *parts = realloc(horizon->parts, (size_t)(horizon->part_count + 1) * sizeof *parts);
  if (!parts) return 0;
  horizon->parts = parts;
  part *made = &parts[horizon->part_count];
  *made = (part){.tape = tape, .repeats = repeats, .arguments = arguments, .outputs = outputs};
  made->sources = malloc((size_t)(arguments + 1) * sizeof *made->sources);
  made->offsets = malloc((size_t)(arguments * repeats + 1) * sizeof *made->offsets);
  if (!made->sources || !made->offsets) {
    free(made->sources);
    free(made->offsets);
    return 0;
  }
  memcpy(made->sources, sources, (size_t)arguments * sizeof *sources);
  memcpy(made->offsets, offsets, (size_t)(arguments * repeats) * sizeof *offsets);
  made->logical = horizon->logical;
  made->physical = horizon->physical;
  horizon->part_count++;
  horizon->logical += repeats * outputs;
  horizon->physical += blocks_of(horizon, made) * horizon->width * outputs;
  if (tape && tape->registers > horizon->registers) horizon->registers = tape->registers;
  if (arguments > horizon->pointers) horizon->pointers = arguments;
  return horizon->physical <= INT32_MAX;
}

/* Return where in memory values lie, and mark the parts that they are of; NULL where there is no memory. */
static int32_t *placed(const mt_horizon *horizon, int64_t count, const int64_t *values, unsigned char *needs) {
  int32_t *places = malloc((size_t)(count + 1) * sizeof *places);
  if (!places) return NULL;
  int64_t p = 0;
  for (int64_t k = 0; k < count; k++) {
    if (values[k] < 0) {
      places[k] = -1;
      continue;
    }
    while (p > 0 && values[k] < horizon->parts[p].logical) p--;
    while (p + 1 < horizon->part_count && values[k] >= horizon->parts[p + 1].logical) p++;
    const part *mine = &horizon->parts[p];
    const int64_t within = values[k] - mine->logical, repeat = within / mine->outputs, output = within % mine->outputs;
    const int64_t width = horizon->width;
    places[k] = (int32_t)(mine->physical + (repeat / width * mine->outputs + output) * width + repeat % width);
    needs[p] = 1;
  }
  return places;
}

int mt_horizon_result(mt_horizon *horizon, int64_t index, int64_t size, const int64_t *first, int64_t more,
                      const int64_t *targets, const int64_t *terms) {
  result *made = &horizon->results[index];
  made->size = size;
  made->more = more;
  made->needs = calloc((size_t)horizon->part_count + 1, 1);
  made->targets = malloc((size_t)(more + 1) * sizeof *made->targets);
  if (!made->needs || !made->targets) return 0;
  for (int64_t k = 0; k < more; k++) made->targets[k] = (int32_t)targets[k];
  made->first = placed(horizon, size, first, made->needs);
  made->terms = placed(horizon, more, terms, made->needs);
  return made->first && made->terms;
}

/* A run of a horizon, which its threads share. */
typedef struct {
  const mt_horizon *horizon;
  const double *const *sources, *const *brought;
  double *const *results;
  scratch *memory;
  const unsigned char *needed; /* (parts) */
  int64_t blocks;              /* of all parts that are needed */
  atomic_int next;             /* the first block that nobody has taken */
  int threads;
} run;

static void run_block(const run *mine, const part *some, int64_t block, double *registers) {
  const mt_horizon *horizon = mine->horizon;
  const int64_t width = horizon->width;
  const double **pointers = (const double **)(registers + horizon->registers * width);
  for (int64_t a = 0; a < some->arguments; a++) {
    for (int64_t lane = 0; lane < width; lane++) {
      int64_t repeat = block * width + lane;
      if (repeat >= some->repeats) repeat = some->repeats - 1; /* computed again, and not used */
      pointers[a * width + lane] = mine->sources[some->sources[a]] + some->offsets[a * some->repeats + repeat];
    }
  }
  double *values = mine->memory->values + some->physical + block * width * some->outputs;
  MT_CHOOSE(mt_tape_run)(some->tape, pointers, registers, values);
}

/* Put values that the caller brought where a tape would have put them. */
static void copy_block(const run *mine, const part *some, const double *brought, int64_t block) {
  const int64_t width = mine->horizon->width;
  double *values = mine->memory->values + some->physical + block * width * some->outputs;
  for (int64_t lane = 0; lane < width && block * width + lane < some->repeats; lane++) {
    const double *column = brought + (block * width + lane) * some->outputs;
    for (int64_t output = 0; output < some->outputs; output++) values[output * width + lane] = column[output];
  }
}

static int64_t registers_size(const mt_horizon *horizon) {
  const int64_t pointers = horizon->pointers * horizon->width * (int64_t)sizeof(double *) / (int64_t)sizeof(double);
  return (horizon->registers * horizon->width + pointers + 16) / 8 * 8;
}

static void take_blocks(void *context, int thread) {
  run *mine = context;
  const mt_horizon *horizon = mine->horizon;
  double *registers = mine->memory->registers + thread * registers_size(horizon);
  for (;;) {
    int64_t block = atomic_fetch_add(&mine->next, 1), p = 0;
    if (block >= mine->blocks) return;
    for (;; p++) {
      if (!mine->needed[p]) continue;
      const int64_t count = blocks_of(horizon, &horizon->parts[p]);
      if (block < count) break;
      block -= count;
    }
    const part *some = &horizon->parts[p];
    if (some->tape) run_block(mine, some, block, registers);
    else copy_block(mine, some, mine->brought[p], block);
  }
}

/* Return the first of the added values whose target is not below a number. */
static int64_t first_from(const result *some, int64_t number) {
  int64_t low = 0, high = some->more;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (some->targets[middle] < number) low = middle + 1;
    else high = middle;
  }
  return low;
}

static void put_share(void *context, int thread) {
  const run *mine = context;
  const double *values = mine->memory->values;
  for (int64_t r = 0; r < mine->horizon->result_count; r++) {
    double *out = mine->results[r];
    if (!out) continue;
    const result *some = &mine->horizon->results[r];
    const int64_t from = some->size * thread / mine->threads, to = some->size * (thread + 1) / mine->threads;
    for (int64_t k = from; k < to; k++) out[k] = some->first[k] < 0 ? 0.0 : values[some->first[k]];
    for (int64_t k = first_from(some, from), end = first_from(some, to); k < end;) {
      const int32_t target = some->targets[k];
      double sum = 0.0;
      for (; k < end && some->targets[k] == target; k++) sum += values[some->terms[k]];
      out[target] += sum;
    }
  }
}

static scratch *new_scratch(const mt_horizon *horizon, int threads) {
  scratch *made = calloc(1, sizeof *made);
  if (!made) return NULL;
  const size_t values = (size_t)(horizon->physical + 7) / 8 * 8, registers = (size_t)registers_size(horizon);
  made->threads = threads;
  made->memory = malloc((values + (size_t)threads * registers) * sizeof(double) + ALIGNMENT);
  if (!made->memory) {
    free(made);
    return NULL;
  }
  made->values = (double *)(((uintptr_t)made->memory + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT);
  made->registers = made->values + values;
  return made;
}

static int run_with(mt_horizon *horizon, unsigned char *needed, const double *const *sources, double *const *results,
                    const double *const *brought) {
  run mine = {.horizon = horizon, .sources = sources, .brought = brought, .results = results, .needed = needed};
  int64_t work = 0;
  for (int64_t r = 0; r < horizon->result_count; r++) {
    if (!results[r]) continue;
    work += horizon->results[r].size;
    for (int64_t p = 0; p < horizon->part_count; p++) needed[p] |= horizon->results[r].needs[p];
  }
  for (int64_t p = 0; p < horizon->part_count; p++) {
    if (!needed[p]) continue;
    const part *some = &horizon->parts[p];
    if (!some->tape && !(brought && brought[p])) return 0;
    mine.blocks += blocks_of(horizon, some);
    work += blocks_of(horizon, some) * (some->tape ? some->tape->count : some->outputs);
  }
  mine.threads = work < WORTH_SHARING ? 1 : mt_threads();
  mine.memory = atomic_exchange(&horizon->kept, NULL);
  if (mine.memory && mine.memory->threads < mine.threads) {
    delete_scratch(mine.memory);
    mine.memory = NULL;
  }
  if (!mine.memory) mine.memory = new_scratch(horizon, mine.threads);
  if (!mine.memory) return 0;
  mt_parallel(mine.threads, take_blocks, &mine);
  mt_parallel(mine.threads, put_share, &mine);
  delete_scratch(atomic_exchange(&horizon->kept, mine.memory));
  return 1;
}

int mt_horizon_run(mt_horizon *horizon, const double *const *sources, double *const *results,
                   const double *const *brought) {
  unsigned char *needed = calloc((size_t)horizon->part_count + 1, 1);
  const int done = needed && run_with(horizon, needed, sources, results, brought);
  free(needed);
  return done;
}
