/* The calling convention of MA27, by which IPOPT asks for a linear solver that it loads at run time.
 *
 * Seen from IPOPT's side, its open interface to such a library (coin-or/Ipopt, IpMa27TSolverInterface.cpp): MA27ID sets
 * options, MA27AD takes the structure, MA27BD the values, MA27CD a right-hand side; INFO(1) tells what went wrong, −5 a
 * singular matrix, and INFO(15) the number of negative eigenvalues. IPOPT hands ICNTL on to every call and leaves most of
 * it alone, so an entry carries the number of the solver: each solve of IPOPT has its own, in whatever thread it runs.
 */
#include "kkt_solver.h"
#include "thread.h"

#include <stdlib.h>
#include <string.h>

enum { ICNTL_SIZE = 30, CNTL_SIZE = 5, INFO_SIZE = 20, OURS = 28 };
enum { NOT_OURS = -1, SINGULAR = -5 };

typedef struct {
  int number;
  Kkt *kkt;
} Place;

static mt_lock lock = MT_LOCK_INIT; /* of the three that follow */
static Place *places;
static int count, last_number;
static _Thread_local int announced;

/* Return the number of a solver from now on; 0: no memory. */
MT_EXPORT int mt_kkt_open(Kkt *kkt) {
  int number = 0;
  mt_acquire(&lock);
  Place *more = realloc(places, sizeof(Place) * ((size_t)count + 1));
  if (more) {
    places = more;
    number = last_number = last_number == 0x7fffffff ? 1 : last_number + 1;
    places[count++] = (Place){number, kkt};
  }
  mt_release(&lock);
  return number;
}

/* Forget a number. */
MT_EXPORT void mt_kkt_close(int number) {
  mt_acquire(&lock);
  for (int i = 0; i < count; i++)
    if (places[i].number == number) {
      places[i] = places[--count];
      break;
    }
  mt_release(&lock);
}

/* Say which solver the solves of IPOPT that begin in this thread take; 0: none. */
MT_EXPORT void mt_kkt_announce(int number) { announced = number; }

static Kkt *solver(const int *icntl) {
  Kkt *found = NULL;
  mt_acquire(&lock);
  for (int i = 0; i < count; i++)
    if (places[i].number == icntl[OURS]) found = places[i].kkt;
  mt_release(&lock);
  return found;
}

MT_EXPORT void ma27id_(int *icntl, double *cntl) {
  memset(icntl, 0, sizeof(int) * ICNTL_SIZE);
  memset(cntl, 0, sizeof(double) * CNTL_SIZE);
  icntl[OURS] = announced;
}

MT_EXPORT void ma27ad_(const int *n, const int *nz, const int *irn, const int *icn, int *iw, int *liw, int *ikeep, int *iw1,
                       int *nsteps, int *iflag, int *icntl, double *cntl, int *info, double *ops) {
  (void)iw, (void)liw, (void)ikeep, (void)iw1, (void)iflag, (void)cntl, (void)ops;
  Kkt *kkt = solver(icntl);
  memset(info, 0, sizeof(int) * INFO_SIZE);
  *nsteps = 1;
  info[4] = *nz; /* what IPOPT is to hold for the values and for integers */
  info[5] = 1;
  if (!kkt || !kkt_take_structure(kkt, *n, *nz, irn, icn)) info[0] = NOT_OURS;
}

MT_EXPORT void ma27bd_(const int *n, const int *nz, const int *irn, const int *icn, double *a, int *la, int *iw, int *liw,
                       int *ikeep, int *nsteps, int *maxfrt, int *iw1, int *icntl, double *cntl, int *info) {
  (void)irn, (void)icn, (void)la, (void)iw, (void)liw, (void)ikeep, (void)nz, (void)iw1, (void)cntl;
  Kkt *kkt = solver(icntl);
  memset(info, 0, sizeof(int) * INFO_SIZE);
  *nsteps = *maxfrt = 1;
  int status = kkt ? kkt_take_values(kkt, a, &info[14]) : KKT_NO_MEMORY;
  if (!kkt || mt_kkt_refusal(kkt)) {
    info[0] = NOT_OURS;
  } else if (status) {
    info[0] = SINGULAR;
    info[1] = *n - 1; /* its rank, as IPOPT may print it */
  }
}

MT_EXPORT void ma27cd_(const int *n, double *a, int *la, int *iw, int *liw, double *w, int *maxfrt, double *rhs, int *iw1,
                       int *nsteps, int *icntl, int *info) {
  (void)n, (void)a, (void)la, (void)iw, (void)liw, (void)w, (void)maxfrt, (void)iw1, (void)nsteps;
  Kkt *kkt = solver(icntl);
  memset(info, 0, sizeof(int) * INFO_SIZE);
  if (!kkt || !kkt_take_right_side(kkt, rhs)) info[0] = NOT_OURS;
}
