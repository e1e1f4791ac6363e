// Not a test of the library: gives it a handle that was never set, which valgrind must find.

#include "check.h"

int main(int count, char **arguments) {
    CHECK(count == 2);
    rohrpost_node node;
    DONE(rohrpost_node_open_directory(arguments[1], true, ROHRPOST_NAME(1, 200, 0, 0), &node));
    rohrpost_sender *sender = (rohrpost_sender *)malloc(sizeof *sender);
    (void)rohrpost_sender_close(*sender);
    free(sender);
    puts("all is well");
    return 0;
}
