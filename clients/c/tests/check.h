// What the C programs of the tests have in common.

#include "rohrpost.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Ends the program with the place of what does not hold.
#define CHECK(holds)                                                                                   \
    do {                                                                                               \
        if (!(holds)) {                                                                                \
            fprintf(stderr, "%s:%d: %s; last error: %s\n", __FILE__, __LINE__, #holds, rohrpost_last_error()); \
            exit(1);                                                                                   \
        }                                                                                              \
    } while (0)

// Checks a call's code.
#define GIVES(code, call)                                                                              \
    do {                                                                                               \
        rohrpost_code given_ = (call);                                                                 \
        if (given_ != (code)) {                                                                        \
            fprintf(stderr, "%s:%d: %s gives %d (%s), not %s; last error: %s\n", __FILE__, __LINE__,   \
                #call, (int)given_, rohrpost_error_text(given_), #code, rohrpost_last_error());        \
            exit(1);                                                                                   \
        }                                                                                              \
    } while (0)

#define DONE(call) GIVES(ROHRPOST_OK, call)

// Whether the last error has these words in it.
#define SAYS(words) CHECK(strstr(rohrpost_last_error(), words) != NULL)
