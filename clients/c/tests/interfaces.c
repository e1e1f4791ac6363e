// Interfaces by tables: their hashes, and tables that are not as they should be.

#include "rohrpost_types.h"

#include "check.h"

static const rohrpost_type NUMBERS[] = {ROHRPOST_U8};
static const rohrpost_type PAIR[] = {ROHRPOST_TEXT, ROHRPOST_BOOL};
static const rohrpost_type WORDS[] = {ROHRPOST_TEXT};
static const rohrpost_type VALUES[] = {ROHRPOST_TEXT, ROHRPOST_F64};
static const rohrpost_field WRAPPED = ROHRPOST_FIELD(NULL, ROHRPOST_I16, NULL, NULL);
static const rohrpost_named EITHER = ROHRPOST_VARIANT("Either", NULL);
static const rohrpost_named EITHERS[] = {
    ROHRPOST_VARIANT("Nothing", NULL),
    ROHRPOST_VARIANT_OF("Number", NULL, &WRAPPED),
    ROHRPOST_NAMED("Pose", NULL, ROHRPOST_POSE_FIELDS),
};
static const rohrpost_field ARGUMENTS[] = {
    ROHRPOST_FIELD("numbers", ROHRPOST_ARRAY(3, NUMBERS), NULL, "Three."),
    ROHRPOST_FIELD("words", ROHRPOST_OPTION(WORDS), NULL, NULL),
    ROHRPOST_FIELD("letter", ROHRPOST_CHAR, NULL, NULL),
    ROHRPOST_FIELD("either", ROHRPOST_ENUM(EITHER, EITHERS), NULL, NULL),
    ROHRPOST_FIELD("large", ROHRPOST_U128, NULL, NULL),
    ROHRPOST_BOUNDED("share", ROHRPOST_F32, "%", NULL, "0", "100"),
};
static const rohrpost_function FUNCTIONS[] = {
    ROHRPOST_FUNCTION(16, "all", ARGUMENTS, ROHRPOST_TUPLE(PAIR), "Takes all."),
    ROHRPOST_ASKED(17, "nothing", ROHRPOST_UNIT, NULL),
};
static const rohrpost_data DATA[] = {
    ROHRPOST_PUBLISHED(1, "values", ROHRPOST_MAP(VALUES), NULL, NULL),
    ROHRPOST_STREAMED(2, "image", ROHRPOST_STRUCT(ROHRPOST_IMAGE), NULL, NULL),
};
static const rohrpost_interface ZOO =
    ROHRPOST_INTERFACE("Zoo", "zoo", "Has all kinds.", ROHRPOST_ALL(FUNCTIONS), ROHRPOST_ALL(DATA));

// Interfaces of one datum, of this type.
static rohrpost_code hash_of(rohrpost_type type) {
    rohrpost_data data = {1, false, {"data", type, NULL, NULL, NULL, NULL}};
    const rohrpost_interface interface = ROHRPOST_INTERFACE("I", "i", NULL, ROHRPOST_NONE, ROHRPOST_NONE);
    rohrpost_interface with_data = interface;
    with_data.data = &data;
    with_data.data_count = 1;
    uint32_t hash;
    return rohrpost_interface_hash(&with_data, &hash);
}

static void the_order_of_the_tables_does_not_count(void) {
    const rohrpost_function functions[] = {FUNCTIONS[1], FUNCTIONS[0]};
    const rohrpost_data data[] = {DATA[1], DATA[0]};
    rohrpost_interface turned = ZOO;
    turned.functions = functions;
    turned.data = data;
    uint32_t hashes[2];
    DONE(rohrpost_interface_hash(&ZOO, &hashes[0]));
    DONE(rohrpost_interface_hash(&turned, &hashes[1]));
    CHECK(hashes[0] == hashes[1]);
}

static void tables_that_cannot_be_are_codes(void) {
    uint32_t hash;
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_interface_hash(NULL, &hash));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_interface_hash(&ZOO, NULL));
    const rohrpost_type plain = ROHRPOST_U8;
    DONE(hash_of(plain));
    rohrpost_type type = plain;
    type.kind = 24;
    GIVES(ROHRPOST_VALUE, hash_of(type));
    type.kind = ROHRPOST_KIND_LIST;
    GIVES(ROHRPOST_NULL_POINTER, hash_of(type));
    type.types = &type;
    GIVES(ROHRPOST_VALUE, hash_of(type));
    SAYS("contain itself");
    type.kind = ROHRPOST_KIND_TUPLE;
    type.count = UINT32_MAX;
    GIVES(ROHRPOST_TOO_LARGE, hash_of(type));
    rohrpost_named named = {NULL, NULL, ROHRPOST_MEMBERS_FIELDS, ROHRPOST_POSE_FIELDS, 3};
    type.kind = ROHRPOST_KIND_STRUCT;
    type.named = &named;
    GIVES(ROHRPOST_NULL_POINTER, hash_of(type));
    named.name = "\xff";
    GIVES(ROHRPOST_VALUE, hash_of(type));
    named.name = "Pose";
    named.members = ROHRPOST_MEMBERS_ONE;
    GIVES(ROHRPOST_VALUE, hash_of(type));
    SAYS("`Pose` has 3 fields");
    named.members = ROHRPOST_MEMBERS_FIELDS;
    named.field_count = SIZE_MAX;
    GIVES(ROHRPOST_TOO_LARGE, hash_of(type));
    rohrpost_function bad = FUNCTIONS[1];
    rohrpost_interface interface = ZOO;
    interface.functions = &bad;
    interface.function_count = 1;
    bad.number = 15;
    GIVES(ROHRPOST_VALUE, rohrpost_interface_hash(&interface, &hash));
    rohrpost_function twice[2] = {FUNCTIONS[0], FUNCTIONS[0]};
    interface.functions = twice;
    interface.function_count = 2;
    GIVES(ROHRPOST_VALUE, rohrpost_interface_hash(&interface, &hash));
    rohrpost_field bounded = ROHRPOST_BOUNDED("b", ROHRPOST_U8, NULL, NULL, "300", NULL);
    bad = FUNCTIONS[0];
    bad.arguments = &bounded;
    bad.argument_count = 1;
    interface.functions = &bad;
    interface.function_count = 1;
    GIVES(ROHRPOST_VALUE, rohrpost_interface_hash(&interface, &hash));
    SAYS("300 is out of range");
    static const uint8_t CUT[] = {2, 9};
    const rohrpost_interface cut = ROHRPOST_DESCRIBED(CUT);
    GIVES(ROHRPOST_VALUE, rohrpost_interface_hash(&cut, &hash));
    SAYS("ends too early");
}

static void bytes_and_tables_are_one_interface(void) {
    static const uint8_t BYTES[] = {2, 1, 'I', 1, 'i', 0, 0, 0};
    const rohrpost_interface described = ROHRPOST_DESCRIBED(BYTES);
    const rohrpost_interface written =
        ROHRPOST_INTERFACE("I", "i", "Texts do not count.", ROHRPOST_NONE, ROHRPOST_NONE);
    uint32_t hashes[2];
    DONE(rohrpost_interface_hash(&described, &hashes[0]));
    DONE(rohrpost_interface_hash(&written, &hashes[1]));
    CHECK(hashes[0] == hashes[1]);
}

// What only a module's functions may ask.
static void outside_of_a_module_all_is_refused(void) {
    uint32_t number;
    uint8_t *room;
    rohrpost_time now;
    rohrpost_decoder value;
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_name(&number));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_now(&now));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_period(1));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_publish(1, 0, "x", 1));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_begin(1, 0, "x", 1, 1, &room));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_finish(NULL));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_abandon());
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_parameter("x", &value));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_follow("x.0", "y", 0, 0, &number));
    GIVES(ROHRPOST_VALUE, rohrpost_module_follow("x.0", "y", 9, 0, &number));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_call("x.0", 7, 16, NULL, 0, 1, &value));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_get("x.0", 7, 1, 1, &value));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_watch(0, ROHRPOST_READ, &number));
    GIVES(ROHRPOST_OUTSIDE, rohrpost_module_unwatch(0));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_say(ROHRPOST_LEVEL_INFO, NULL));
    GIVES(ROHRPOST_VALUE, rohrpost_say(9, "x"));
    DONE(rohrpost_say(ROHRPOST_LEVEL_INFO, "nobody hears it"));
    GIVES(ROHRPOST_FAILED, rohrpost_fail("as it should"));
    SAYS("as it should");
    CHECK(rohrpost_module_run(NULL, 0, NULL) == 1);
}

int main(void) {
    const rohrpost_interface *interfaces[] = {&ROHRPOST_WHEELS, &ROHRPOST_LASER, &ROHRPOST_CAMERA, &ZOO};
    for (size_t at = 0; at < ROHRPOST_COUNT(interfaces); at++) {
        uint32_t hash;
        DONE(rohrpost_interface_hash(interfaces[at], &hash));
        printf("%08x\n", (unsigned)hash);
    }
    bytes_and_tables_are_one_interface();
    the_order_of_the_tables_does_not_count();
    tables_that_cannot_be_are_codes();
    outside_of_a_module_all_is_refused();
    puts("all is well");
    return 0;
}
