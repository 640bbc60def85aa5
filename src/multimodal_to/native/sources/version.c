/* Which sources the library was built from; Python takes only a library of the sources that are beside it. */
#include "common.h"

MT_EXPORT const char *mt_fingerprint(void) { return MT_FINGERPRINT; }
