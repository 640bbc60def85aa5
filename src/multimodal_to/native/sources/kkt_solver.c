/* A linear solver for the KKT matrices of one problem. */
#include "kkt_solver.h"
#include "parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define PIVOT_LEAST 1e-8      /* usual threshold of pivots */
#define PIVOT_SAFER 1e-5      /* where solves were poor */
#define RESIDUAL_REACH 1e-10  /* |K x − b| / |b| that ends refinement */
#define RESIDUAL_POOR 1e-6    /* |K x − b| / (|x| + |b|) that asks for another factorisation */
enum { REFINEMENTS_MOST = 3, LARGEST_FRONT = 2000, SHARES = 8 };
#define OPERATIONS_MOST 2e11

struct Kkt {
  KktArena arena;
  KktPattern pattern;
  KktPlan plan[2];      /* with rows that define variables, and without */
  const KktPlan *current;
  KktMatrix matrix;
  KktOutcome outcome;
  KktCounts counts;
  int *irn, *jcn;       /* of the structure that was taken */
  double *right_side, *residual, *best;
  const char *refusal;
  int knots_given;
};

static double now(void) {
  struct timespec time;
  timespec_get(&time, TIME_UTC);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

Kkt *mt_kkt_new(int variables, int slacks, int equalities, int knots, const int *knot) {
  Kkt *kkt = calloc(1, sizeof(Kkt));
  int *copy = malloc(sizeof(int) * ((size_t)variables + 1));
  if (!kkt || !copy) {
    free(kkt);
    free(copy);
    return NULL;
  }
  memcpy(copy, knot, sizeof(int) * (size_t)variables);
  kkt->pattern = (KktPattern){
    .variables = variables, .slacks = slacks, .equalities = equalities, .size = variables + 2 * slacks + equalities,
    .knots = knots, .knot = copy,
  };
  return kkt;
}

static void forget_structure(Kkt *kkt) {
  for (int i = 0; i < 2; i++) kkt_free_plan(&kkt->plan[i]);
  kkt_give_back(&kkt->arena);
  kkt->current = NULL;
  kkt->irn = kkt->jcn = NULL;
}

void mt_kkt_free(Kkt *kkt) {
  if (!kkt) return;
  forget_structure(kkt);
  free((void *)kkt->pattern.knot);
  free(kkt);
}

const char *mt_kkt_refusal(const Kkt *kkt) { return kkt->refusal; }

void mt_kkt_counts(const Kkt *kkt, KktCounts *counts) {
  *counts = kkt->counts;
  const KktPlan *plan = &kkt->plan[0];
  if (!plan->front) return;
  counts->operations = plan->operations;
  counts->largest_front = plan->largest;
  counts->definitions = plan->definitions.count;
  for (int k = 0; k < plan->fronts; k++) counts->pairs += plan->front[k].pairs;
}

static int refuse(Kkt *kkt, const char *why) {
  kkt->refusal = why;
  return 0;
}

static const char *knots_are_wrong(const KktPattern *p) {
  if (p->knots < 1) return "there are no knots";
  for (int i = 0; i < p->variables; i++)
    if (p->knot[i] < -1 || p->knot[i] >= p->knots) return "a variable is of a knot that there is not";
  return NULL;
}

static double *numbers(KktArena *arena, int count) { return kkt_take(arena, (size_t)count + 1, sizeof(double)); }

static const char *read_structure(Kkt *kkt, int triplets, const int *irn, const int *jcn) {
  KktPattern *p = &kkt->pattern;
  KktArena *arena = &kkt->arena;
  size_t bytes = sizeof(int) * (size_t)triplets;
  const char *refusal = knots_are_wrong(p);
  if (refusal) return refusal;
  p->triplets = triplets;
  kkt->irn = kkt_take(arena, (size_t)triplets + 1, sizeof(int));
  kkt->jcn = kkt_take(arena, (size_t)triplets + 1, sizeof(int));
  memcpy(kkt->irn, irn, bytes);
  memcpy(kkt->jcn, jcn, bytes);
  refusal = kkt_read_pattern(arena, p, irn, jcn);
  kkt->matrix = (KktMatrix){
    .pattern = p, .threshold = PIVOT_LEAST,
    .value = numbers(arena, p->entries), .determinant = numbers(arena, p->slacks),
    .rounding = numbers(arena, p->size), .solution = numbers(arena, 2 * p->size),
    .multiplier = numbers(arena, p->slacks),
  };
  kkt->right_side = numbers(arena, p->size);
  kkt->residual = numbers(arena, p->size);
  kkt->best = numbers(arena, p->size);
  return refusal;
}

int kkt_take_structure(Kkt *kkt, int size, int triplets, const int *irn, const int *jcn) {
  size_t bytes = sizeof(int) * (size_t)triplets;
  jmp_buf failure;
  if (size != kkt->pattern.size) return refuse(kkt, "the KKT matrix has another size than was announced");
  if (kkt->irn && triplets == kkt->pattern.triplets && !memcmp(irn, kkt->irn, bytes) && !memcmp(jcn, kkt->jcn, bytes))
    return 1;
  forget_structure(kkt);
  if (setjmp(failure)) {
    forget_structure(kkt);
    return refuse(kkt, "there is not enough memory for the structured factorisation");
  }
  kkt->arena.failure = &failure;
  const char *refusal = read_structure(kkt, triplets, irn, jcn);
  kkt->arena.failure = NULL;
  if (!refusal) return 1;
  forget_structure(kkt);
  return refuse(kkt, refusal);
}

static int make_plan(Kkt *kkt, KktPlan *plan, int without) {
  jmp_buf failure;
  if (setjmp(failure)) return refuse(kkt, "there is not enough memory for the structured factorisation");
  plan->arena.failure = &failure;
  kkt_make_plan(plan, &kkt->pattern, kkt->matrix.value, !without);
  if (plan->largest > LARGEST_FRONT || plan->operations > OPERATIONS_MOST)
    return refuse(kkt, "knots are coupled by too many unknowns for the structured factorisation");
  kkt_take_work(plan);
  plan->arena.failure = NULL;
  return 1;
}

/* Return the plan with or without definitions, made where it is needed first; NULL where there is none. */
static KktPlan *plan_of(Kkt *kkt, int without) {
  KktPlan *plan = &kkt->plan[without];
  double started = now();
  if (plan->factors) return plan;
  if (!make_plan(kkt, plan, without)) {
    kkt_free_plan(plan);
    return NULL;
  }
  kkt->counts.seconds_planning += now() - started;
  return plan;
}

static int factorise(Kkt *kkt, int without, int break_off) {
  KktPlan *plan = plan_of(kkt, without);
  kkt->current = NULL;
  if (!plan) return KKT_NO_MEMORY;
  if (!without && !kkt_definitions_hold(&kkt->matrix, plan)) return factorise(kkt, 1, break_off);
  kkt->outcome = kkt_factorise(&kkt->matrix, plan, break_off);
  kkt->counts.fronts += kkt->outcome.fronts;
  if (without) kkt->counts.without_definitions++;
  if (kkt->outcome.status == KKT_NO_MEMORY) {
    refuse(kkt, "there is not enough memory for the structured factorisation");
  } else if (!without && (kkt->outcome.status == KKT_SINGULAR || kkt->outcome.status == KKT_CROWDED)) {
    return factorise(kkt, 1, break_off); /* more freedom to pivot */
  }
  if (!kkt->outcome.status) kkt->current = plan;
  return kkt->outcome.status;
}

typedef struct {
  const KktMatrix *matrix;
  const double *values; /* of IPOPT's triplets */
  double nothing[SHARES];
} Taking;

static void take_share(void *context, int share) {
  Taking *taking = context;
  const KktPattern *p = taking->matrix->pattern;
  double nothing = 0; /* 0 · v is 0 of finite numbers only */
  for (int e = kkt_share(p->entries, share, SHARES); e < kkt_share(p->entries, share + 1, SHARES); e++) {
    double sum = 0;
    for (int q = p->triplet_start[e]; q < p->triplet_start[e + 1]; q++) sum += taking->values[p->triplet[q]];
    taking->matrix->value[e] = sum;
    nothing += 0 * sum;
  }
  taking->nothing[share] = nothing;
}

int kkt_take_values(Kkt *kkt, const double *values, int *negative) {
  const KktPattern *p = &kkt->pattern;
  double started = now(), nothing = 0;
  if (!kkt->irn) return KKT_SINGULAR; /* no structure was taken */
  Taking taking = {.matrix = &kkt->matrix, .values = values};
  mt_parallel(SHARES, take_share, &taking);
  for (int share = 0; share < SHARES; share++) nothing += taking.nothing[share];
  kkt->matrix.threshold = PIVOT_LEAST;
  kkt->current = NULL;
  int status = nothing == 0 ? factorise(kkt, 0, 1) : KKT_NO_NUMBER;
  kkt->counts.factorisations++;
  kkt->counts.seconds_factorising += now() - started;
  if (status) {
    kkt->counts.singular++;
    return status;
  }
  *negative = kkt->outcome.negative;
  if (!kkt->outcome.complete) kkt->counts.broken_off++;
  if (*negative != p->equalities + p->slacks) kkt->counts.wrong_inertia++;
  return KKT_DONE;
}

static double largest(const double *values, int count) {
  double most = 0;
  for (int i = 0; i < count; i++) most = fabs(values[i]) > most || isnan(values[i]) ? fabs(values[i]) : most;
  return most;
}

/* Solve with refinement (J. H. Wilkinson, 1963); returns |K x − b| / (|x| + |b|), infinity where x is no number. */
static double solve_refined(Kkt *kkt, const double *b, double *x) {
  int n = kkt->pattern.size;
  double scale = largest(b, n), last = INFINITY;
  memcpy(x, b, sizeof(double) * (size_t)n);
  kkt_solve(&kkt->matrix, kkt->current, x);
  for (int step = 0;; step++) {
    kkt_residual(&kkt->matrix, b, x, kkt->residual);
    double left = largest(kkt->residual, n);
    if (!(left < last)) { /* no better: back to what was */
      if (step) memcpy(x, kkt->best, sizeof(double) * (size_t)n);
      return isfinite(last) ? last / (scale + largest(x, n)) : INFINITY;
    }
    if (left <= RESIDUAL_REACH * scale || step == REFINEMENTS_MOST) return scale > 0 ? left / (scale + largest(x, n)) : 0;
    last = left;
    memcpy(kkt->best, x, sizeof(double) * (size_t)n);
    kkt_solve(&kkt->matrix, kkt->current, kkt->residual);
    for (int i = 0; i < n; i++) x[i] += kkt->residual[i];
    kkt->counts.refinements++;
  }
}

int kkt_take_right_side(Kkt *kkt, double *rhs) {
  size_t bytes = sizeof(double) * (size_t)kkt->pattern.size;
  double started = now();
  if (!kkt->current) return 0;
  if (!kkt->outcome.complete && factorise(kkt, 0, 0)) return 0;
  memcpy(kkt->right_side, rhs, bytes);
  double found = solve_refined(kkt, kkt->right_side, rhs);
  if (!(found <= RESIDUAL_POOR)) { /* larger pivots, and no pairs that were chosen beforehand */
    kkt->counts.poor_solves++;
    double *first = kkt->matrix.solution; /* free between solves */
    memcpy(first, rhs, bytes);
    kkt->matrix.threshold = PIVOT_SAFER;
    if (!factorise(kkt, 1, 0)) {
      double *kept = malloc(bytes);
      if (kept) memcpy(kept, first, bytes);
      double again = solve_refined(kkt, kkt->right_side, rhs);
      if (kept && !(again < found)) memcpy(rhs, kept, bytes);
      free(kept);
    }
  }
  kkt->counts.solves++;
  kkt->counts.seconds_solving += now() - started;
  return 1;
}
