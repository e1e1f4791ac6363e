// Standard data that modules exchange: their descriptions, which have the hashes of those in Rust, and their values.
//
// Frames are right-handed: x forward (or east), y left (or north), angles counter-clockwise from x.

#ifndef ROHRPOST_TYPES_H
#define ROHRPOST_TYPES_H

#include "rohrpost.h"

// A place and a heading in the plane.
typedef struct rohrpost_pose {
    double x_m;
    double y_m;
    double heading_rad;
} rohrpost_pose;

// How fast a body moves in its own frame.
typedef struct rohrpost_twist {
    double speed_m_s;
    double turn_rate_rad_s;
} rohrpost_twist;

// What a base says of its own motion: counted from where it started, and drifting.
typedef struct rohrpost_odometry {
    rohrpost_pose pose;
    rohrpost_twist twist;
} rohrpost_odometry;

// What the bytes of a pixel are; numbers of several bytes are little-endian.
typedef enum rohrpost_image_format {
    ROHRPOST_GRAY8,
    ROHRPOST_GRAY16,
    ROHRPOST_RGB8,
    ROHRPOST_RGBA8,
    ROHRPOST_BGR8,
    ROHRPOST_DEPTH_F32,
    ROHRPOST_DEPTH16,
    ROHRPOST_JPEG,
    ROHRPOST_PNG
} rohrpost_image_format;

// A picture without its pixels, which follow as bytes.
typedef struct rohrpost_image {
    uint32_t width_px;
    uint32_t height_px;
    // From the first pixel of a row to that of the next; 0 if the picture is a file.
    uint32_t row_bytes;
    // One of `rohrpost_image_format`.
    uint32_t format;
} rohrpost_image;

static const rohrpost_field ROHRPOST_POSE_FIELDS[] = {
    ROHRPOST_FIELD("x_m", ROHRPOST_F64, "m", "Metres along x."),
    ROHRPOST_FIELD("y_m", ROHRPOST_F64, "m", "Metres along y."),
    ROHRPOST_FIELD("heading_rad", ROHRPOST_F64, "rad",
        "Radians, counter-clockwise from x; any multiple of a turn may be added."),
};
static const rohrpost_named ROHRPOST_POSE =
    ROHRPOST_NAMED("rohrpost.Pose", "A place and a heading in the plane.", ROHRPOST_POSE_FIELDS);

static const rohrpost_field ROHRPOST_TWIST_FIELDS[] = {
    ROHRPOST_FIELD("speed_m_s", ROHRPOST_F64, "m/s", "Metres a second, forward."),
    ROHRPOST_FIELD("turn_rate_rad_s", ROHRPOST_F64, "rad/s", "Radians a second, counter-clockwise."),
};
static const rohrpost_named ROHRPOST_TWIST =
    ROHRPOST_NAMED("rohrpost.Twist", "How fast a body moves in its own frame.", ROHRPOST_TWIST_FIELDS);

static const rohrpost_field ROHRPOST_ODOMETRY_FIELDS[] = {
    ROHRPOST_FIELD("pose", ROHRPOST_STRUCT(ROHRPOST_POSE), NULL,
        "Where the base believes to be, in the frame in which it started."),
    ROHRPOST_FIELD("twist", ROHRPOST_STRUCT(ROHRPOST_TWIST), NULL, "How it moves now."),
};
static const rohrpost_named ROHRPOST_ODOMETRY = ROHRPOST_NAMED("rohrpost.Odometry",
    "What a base says of its own motion: counted from where it started, and drifting.", ROHRPOST_ODOMETRY_FIELDS);

static const rohrpost_type ROHRPOST_RANGES_OF[] = {ROHRPOST_F32};
static const rohrpost_type ROHRPOST_POSE_OF[] = {ROHRPOST_STRUCT(ROHRPOST_POSE)};
static const rohrpost_field ROHRPOST_LASER_SCAN_FIELDS[] = {
    ROHRPOST_FIELD("start_rad", ROHRPOST_F32, "rad", "Direction of the first beam, radians."),
    ROHRPOST_FIELD("step_rad", ROHRPOST_F32, "rad",
        "Angle from one beam to the next, radians; negative when the scanner turns clockwise."),
    ROHRPOST_FIELD("range_max_m", ROHRPOST_F32, "m",
        "Readings of this length and more mean that nothing came back, metres."),
    ROHRPOST_FIELD("ranges_m", ROHRPOST_LIST(ROHRPOST_RANGES_OF), "m",
        "Distances in the order of the beams, metres. Not a number: no reading."),
    ROHRPOST_FIELD("pose", ROHRPOST_OPTION(ROHRPOST_POSE_OF), NULL,
        "Where the scanner stood, if its source knows better than odometry (a log that was corrected afterwards)."),
};
static const rohrpost_named ROHRPOST_LASER_SCAN =
    ROHRPOST_NAMED("rohrpost.LaserScan", "One sweep of a range scanner.", ROHRPOST_LASER_SCAN_FIELDS);

static const rohrpost_named ROHRPOST_IMAGE_FORMAT =
    ROHRPOST_VARIANT("rohrpost.ImageFormat", "What the bytes of a pixel are.");
static const rohrpost_named ROHRPOST_IMAGE_FORMATS[] = {
    ROHRPOST_VARIANT("Gray8", "Brightness, u8: 0 is black, 255 white."),
    ROHRPOST_VARIANT("Gray16", "Brightness, u16: 0 is black, 65 535 white."),
    ROHRPOST_VARIANT("Rgb8", "Red, green, blue, u8 each."),
    ROHRPOST_VARIANT("Rgba8", "Red, green, blue, opacity, u8 each."),
    ROHRPOST_VARIANT("Bgr8", "Blue, green, red, u8 each."),
    ROHRPOST_VARIANT("DepthF32", "Distance along the camera's axis, f32, metres; not a number: not known."),
    ROHRPOST_VARIANT("Depth16", "Distance along the camera's axis, u16, millimetres; 0: not known."),
    ROHRPOST_VARIANT("Jpeg", "A JPEG file."),
    ROHRPOST_VARIANT("Png", "A PNG file."),
};
static const rohrpost_field ROHRPOST_IMAGE_FIELDS[] = {
    ROHRPOST_FIELD("width_px", ROHRPOST_U32, "px", "Pixels in a row."),
    ROHRPOST_FIELD("height_px", ROHRPOST_U32, "px", "Rows."),
    ROHRPOST_FIELD("row_bytes", ROHRPOST_U32, "B",
        "Bytes from the first pixel of a row to that of the next, at least those of the row's pixels; 0 if the image "
        "is a file."),
    ROHRPOST_FIELD("format", ROHRPOST_ENUM(ROHRPOST_IMAGE_FORMAT, ROHRPOST_IMAGE_FORMATS), NULL,
        "What the bytes of a pixel are."),
    ROHRPOST_FIELD("pixels", ROHRPOST_BYTES, NULL, "All rows, the last as long as the others; or the file."),
};
static const rohrpost_named ROHRPOST_IMAGE =
    ROHRPOST_NAMED("rohrpost.Image", "A picture.", ROHRPOST_IMAGE_FIELDS);

// Numbers of the streams of the interfaces below.
#define ROHRPOST_WHEELS_ODOMETRY 1
#define ROHRPOST_LASER_SCANS 1
#define ROHRPOST_CAMERA_IMAGE 1

static const rohrpost_data ROHRPOST_WHEELS_DATA[] = {
    ROHRPOST_STREAMED(ROHRPOST_WHEELS_ODOMETRY, "odometry", ROHRPOST_STRUCT(ROHRPOST_ODOMETRY), NULL,
        "Where the base believes to be, and how it moves."),
};
// Tells how far the wheels have turned.
static const rohrpost_interface ROHRPOST_WHEELS = ROHRPOST_INTERFACE("Wheels", "odometry",
    "Tells how far the wheels have turned.", ROHRPOST_NONE, ROHRPOST_ALL(ROHRPOST_WHEELS_DATA));

static const rohrpost_data ROHRPOST_LASER_DATA[] = {
    ROHRPOST_STREAMED(ROHRPOST_LASER_SCANS, "scan", ROHRPOST_STRUCT(ROHRPOST_LASER_SCAN), NULL, "One sweep."),
};
// Sees with a range scanner.
static const rohrpost_interface ROHRPOST_LASER = ROHRPOST_INTERFACE("Laser", "laser", "Sees with a range scanner.",
    ROHRPOST_NONE, ROHRPOST_ALL(ROHRPOST_LASER_DATA));

static const rohrpost_data ROHRPOST_CAMERA_DATA[] = {
    ROHRPOST_STREAMED(ROHRPOST_CAMERA_IMAGE, "image", ROHRPOST_STRUCT(ROHRPOST_IMAGE), NULL, "What it sees."),
};
// Sees pictures.
static const rohrpost_interface ROHRPOST_CAMERA = ROHRPOST_INTERFACE("Camera", "camera", "Sees pictures.",
    ROHRPOST_NONE, ROHRPOST_ALL(ROHRPOST_CAMERA_DATA));

static inline void rohrpost_put_pose(rohrpost_encoder *encoder, const rohrpost_pose *pose) {
    rohrpost_put_f64(encoder, pose->x_m);
    rohrpost_put_f64(encoder, pose->y_m);
    rohrpost_put_f64(encoder, pose->heading_rad);
}

static inline rohrpost_pose rohrpost_get_pose(rohrpost_decoder *decoder) {
    rohrpost_pose pose;
    pose.x_m = rohrpost_get_f64(decoder);
    pose.y_m = rohrpost_get_f64(decoder);
    pose.heading_rad = rohrpost_get_f64(decoder);
    return pose;
}

static inline void rohrpost_put_twist(rohrpost_encoder *encoder, const rohrpost_twist *twist) {
    rohrpost_put_f64(encoder, twist->speed_m_s);
    rohrpost_put_f64(encoder, twist->turn_rate_rad_s);
}

static inline rohrpost_twist rohrpost_get_twist(rohrpost_decoder *decoder) {
    rohrpost_twist twist;
    twist.speed_m_s = rohrpost_get_f64(decoder);
    twist.turn_rate_rad_s = rohrpost_get_f64(decoder);
    return twist;
}

static inline void rohrpost_put_odometry(rohrpost_encoder *encoder, const rohrpost_odometry *odometry) {
    rohrpost_put_pose(encoder, &odometry->pose);
    rohrpost_put_twist(encoder, &odometry->twist);
}

static inline rohrpost_odometry rohrpost_get_odometry(rohrpost_decoder *decoder) {
    rohrpost_odometry odometry;
    odometry.pose = rohrpost_get_pose(decoder);
    odometry.twist = rohrpost_get_twist(decoder);
    return odometry;
}

// All of a picture but its pixels: `rohrpost_put_bytes` writes these, or `rohrpost_put_length(encoder, 0)` ends what
// `rohrpost_module_begin` takes.
static inline void rohrpost_put_image(rohrpost_encoder *encoder, const rohrpost_image *image) {
    rohrpost_put_u32(encoder, image->width_px);
    rohrpost_put_u32(encoder, image->height_px);
    rohrpost_put_u32(encoder, image->row_bytes);
    rohrpost_put_variant(encoder, image->format);
}

// All of a picture but its pixels: `rohrpost_get_bytes` tells where these are.
static inline rohrpost_image rohrpost_get_image(rohrpost_decoder *decoder) {
    rohrpost_image image;
    image.width_px = rohrpost_get_u32(decoder);
    image.height_px = rohrpost_get_u32(decoder);
    image.row_bytes = rohrpost_get_u32(decoder);
    image.format = rohrpost_get_variant(decoder);
    return image;
}

#endif // ROHRPOST_TYPES_H
