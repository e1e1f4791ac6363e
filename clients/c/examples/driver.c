// Drives nothing yet, but tells how far the wheels have turned: a microcontroller says it by a serial line, in counts
// of both wheels, "left right\n", and this makes odometry of it.

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include <rohrpost_types.h>

static const rohrpost_parameter PARAMETERS[] = {
    ROHRPOST_PARAMETER("port", ROHRPOST_TEXT, NULL, "The serial line.", "/dev/ttyUSB0", NULL, NULL),
    ROHRPOST_PARAMETER("count-m", ROHRPOST_F64, "m", "A wheel's way for one count.", "0.001", "0.000001", "1"),
    ROHRPOST_PARAMETER("track-m", ROHRPOST_F64, "m", "From one wheel to the other.", "0.3", "0.01", "10"),
};

struct driver {
    int port;
    uint32_t watch;
    bool has_ended;
    double count_m, track_m;
    // What came of the next line.
    char line[64];
    size_t line_len;
    // The counts that came last, and when.
    long left, right;
    uint64_t counted_ns;
    rohrpost_odometry odometry;
};

static double parameter(const char *name) {
    rohrpost_decoder value;
    return rohrpost_module_parameter(name, &value) == ROHRPOST_OK ? rohrpost_get_f64(&value) : NAN;
}

static rohrpost_outcome parameters_changed(void *user, const char *const *names, size_t count) {
    struct driver *driver = (struct driver *)user;
    for (size_t at = 0; at < count; at++) {
        if (strcmp(names[at], "port") == 0) {
            return rohrpost_fail("the port is opened when the module starts: restart it");
        }
    }
    driver->count_m = parameter("count-m");
    driver->track_m = parameter("track-m");
    return ROHRPOST_OK;
}

// Opens the serial line, raw, and without waiting for a modem.
static rohrpost_outcome made(void *user) {
    struct driver *driver = (struct driver *)user;
    rohrpost_decoder value;
    if (rohrpost_module_parameter("port", &value) != ROHRPOST_OK) {
        return ROHRPOST_FAILED;
    }
    size_t len;
    const char *text = rohrpost_get_text(&value, &len);
    char path[256];
    snprintf(path, sizeof path, "%.*s", (int)len, text);
    struct termios line;
    driver->port = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (driver->port < 0 || tcgetattr(driver->port, &line) != 0) {
        char why[512];
        snprintf(why, sizeof why, "%s: %s", path, strerror(errno));
        return rohrpost_fail(why);
    }
    cfmakeraw(&line);
    cfsetspeed(&line, B115200);
    if (tcsetattr(driver->port, TCSANOW, &line) != 0) {
        return rohrpost_fail("the serial line cannot be set up");
    }
    driver->count_m = parameter("count-m");
    driver->track_m = parameter("track-m");
    return rohrpost_module_watch(driver->port, ROHRPOST_READ, &driver->watch);
}

// Without its line it stays off.
static rohrpost_outcome on(void *user) {
    const struct driver *driver = (const struct driver *)user;
    return driver->has_ended ? rohrpost_fail("the serial line has ended: restart this module") : ROHRPOST_OK;
}

// The first counts say where the wheels are; all others, how far they have turned since.
static rohrpost_outcome counted(struct driver *driver, long left, long right) {
    rohrpost_time now;
    rohrpost_outcome outcome = rohrpost_module_now(&now);
    if (outcome != ROHRPOST_OK) {
        return outcome;
    }
    rohrpost_odometry *odometry = &driver->odometry;
    if (driver->counted_ns != 0) {
        // Of numbers with a fraction: the difference of any two counts is one.
        double left_m = ((double)left - (double)driver->left) * driver->count_m;
        double right_m = ((double)right - (double)driver->right) * driver->count_m;
        double way_m = (left_m + right_m) / 2, turn_rad = (right_m - left_m) / driver->track_m;
        double middle_rad = odometry->pose.heading_rad + turn_rad / 2;
        odometry->pose.x_m += way_m * cos(middle_rad);
        odometry->pose.y_m += way_m * sin(middle_rad);
        odometry->pose.heading_rad += turn_rad;
        double seconds = (double)(now.ns - driver->counted_ns) * 1e-9;
        if (now.ns > driver->counted_ns) {
            odometry->twist.speed_m_s = way_m / seconds;
            odometry->twist.turn_rate_rad_s = turn_rad / seconds;
        }
    }
    driver->left = left;
    driver->right = right;
    driver->counted_ns = now.ns;
    uint8_t bytes[64];
    size_t len;
    rohrpost_encoder encoder = rohrpost_encode(bytes, sizeof bytes);
    rohrpost_put_odometry(&encoder, odometry);
    outcome = rohrpost_encoded(&encoder, &len);
    return outcome == ROHRPOST_OK ? rohrpost_module_publish(ROHRPOST_WHEELS_ODOMETRY, now.ns, bytes, len) : outcome;
}

// Two numbers, neither of which is too large.
static bool two_counts(const char *line, long *left, long *right) {
    char *first_end, *second_end;
    errno = 0;
    *left = strtol(line, &first_end, 10);
    *right = strtol(first_end, &second_end, 10);
    return errno == 0 && first_end != line && second_end != first_end;
}

static rohrpost_outcome line_came(struct driver *driver) {
    long left, right;
    driver->line[driver->line_len] = '\0';
    driver->line_len = 0;
    if (two_counts(driver->line, &left, &right)) {
        return counted(driver, left, right);
    }
    return rohrpost_say(ROHRPOST_LEVEL_WARN, "the serial line says something that is not two counts");
}

static rohrpost_outcome ready(void *user, const rohrpost_ready *what) {
    struct driver *driver = (struct driver *)user;
    char bytes[256];
    ssize_t came = read(driver->port, bytes, sizeof bytes);
    if (came == 0 || (came < 0 && errno != EAGAIN && errno != EINTR)) {
        rohrpost_module_unwatch(what->watch);
        driver->has_ended = true;
        return rohrpost_fail("the serial line has ended");
    }
    for (ssize_t at = 0; at < came; at++) {
        if (bytes[at] == '\n') {
            rohrpost_outcome outcome = line_came(driver);
            if (outcome != ROHRPOST_OK) {
                return outcome;
            }
        } else if (driver->line_len < sizeof driver->line - 1) {
            driver->line[driver->line_len++] = bytes[at];
        }
    }
    return ROHRPOST_OK;
}

int main(int count, char **arguments) {
    static struct driver driver;
    static rohrpost_module module;
    module.interface = &ROHRPOST_WHEELS;
    module.parameters = PARAMETERS;
    module.parameter_count = ROHRPOST_COUNT(PARAMETERS);
    module.user = &driver;
    module.made = made;
    module.on = on;
    module.ready = ready;
    module.parameters_changed = parameters_changed;
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
