//! Definitions of the standard messages, as their packages have them (common_interfaces, geometry2, rcl_interfaces of
//! ROS 2; their comments are left out).

/// What stands between a definition and those it needs.
const RULE: &str = "================================================================================";

/// Package and name, and the fields.
const DEFINITIONS: [(&str, &str); 26] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Float64", "float64 data\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z\n"),
    ("geometry_msgs/Polygon", "Point32[] points\n"),
    ("geometry_msgs/PolygonStamped", "std_msgs/Header header\nPolygon polygon\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose\n"),
    ("geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\nTwist twist\n"),
    ("geometry_msgs/TwistWithCovariance", "Twist twist\nfloat64[36] covariance\n"),
    ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    ),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist\n",
    ),
    (
        "nav_msgs/MapMetaData",
        "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n\
         geometry_msgs/Pose origin\n",
    ),
    ("nav_msgs/OccupancyGrid", "std_msgs/Header header\nMapMetaData info\nint8[] data\n"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    ),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
         string hardware_id\nKeyValue[] values\n",
    ),
    ("diagnostic_msgs/DiagnosticArray", "std_msgs/Header header\nDiagnosticStatus[] status\n"),
];

/// The definition of a message, `nav_msgs/Odometry`, with those of the messages in it.
pub fn definition(name: &'static str) -> String {
    let mut needed = vec![name.to_owned()];
    let mut text = String::new();
    let mut done = 0;
    while done < needed.len() {
        let name = needed[done].clone();
        done += 1;
        let fields = fields_of(&name);
        if done > 1 {
            text.push_str(&format!("{RULE}\nMSG: {name}\n"));
        }
        text.push_str(fields);
        let package = name.split('/').next().unwrap_or_default();
        for kind in fields.lines().filter_map(|line| line.split([' ', '[']).next()) {
            let full = if kind.contains('/') { kind.to_owned() } else { format!("{package}/{kind}") };
            if !fields_of(&full).is_empty() && !needed.contains(&full) {
                needed.push(full);
            }
        }
    }
    text
}

fn fields_of(name: &str) -> &'static str {
    DEFINITIONS.iter().find(|(known, _)| *known == name).map_or("", |(_, fields)| fields)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_follows_once() {
        let text = definition("nav_msgs/Odometry");
        let told: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
        let expected = [
            "std_msgs/Header",
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/TwistWithCovariance",
            "builtin_interfaces/Time",
            "geometry_msgs/Pose",
            "geometry_msgs/Twist",
            "geometry_msgs/Point",
            "geometry_msgs/Quaternion",
            "geometry_msgs/Vector3",
        ];
        assert_eq!(told, expected);
        assert!(text.starts_with("std_msgs/Header header\nstring child_frame_id\n"));
    }
}
