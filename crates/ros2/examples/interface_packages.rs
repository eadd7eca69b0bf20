//! Writes the ROS interface packages that no Python wheel brings, for peers to build:
//! `cargo run --release -p ros2 --example interface_packages -- DIR`.
#![allow(clippy::disallowed_macros, reason = "a program prints")]

use std::path::Path;

use ros2::definitions::{
    AUTOWARE_CONTROL_MSGS, AUTOWARE_VEHICLE_MSGS, CAN_MSGS, Definition, SIMULATION_INTERFACES,
    TF2_MSGS,
};

fn main() -> std::io::Result<()> {
    let Some(folder) = std::env::args_os().nth(1) else {
        eprintln!("usage: interface_packages DIR");
        std::process::exit(2);
    };
    let folder = Path::new(&folder);
    write(folder, "tf2_msgs", &["geometry_msgs"], TF2_MSGS)?;
    write(folder, "can_msgs", &["std_msgs"], CAN_MSGS)?;
    let needs = ["builtin_interfaces", "std_msgs"];
    write(folder, "autoware_vehicle_msgs", &needs, AUTOWARE_VEHICLE_MSGS)?;
    write(folder, "autoware_control_msgs", &["builtin_interfaces"], AUTOWARE_CONTROL_MSGS)?;
    let needs = ["std_msgs", "geometry_msgs", "action_msgs"];
    write(folder, "simulation_interfaces", &needs, SIMULATION_INTERFACES)
}

/// A package as `ament_cmake` builds it.
fn write(
    folder: &Path,
    name: &str,
    needs: &[&str],
    definitions: &[Definition],
) -> std::io::Result<()> {
    let package = folder.join(name);
    for (path, text) in definitions {
        let path = package.join(path);
        std::fs::create_dir_all(path.parent().unwrap_or(&package))?;
        std::fs::write(path, text)?;
    }
    let depend: String = needs.iter().map(|n| format!("  <depend>{n}</depend>\n")).collect();
    let found: String = needs.iter().map(|n| format!("find_package({n} REQUIRED)\n")).collect();
    let files: Vec<&str> = definitions.iter().map(|(path, _)| *path).collect();
    std::fs::write(
        package.join("package.xml"),
        format!(
            "<?xml version=\"1.0\"?>\n<package format=\"3\">\n  <name>{name}</name>\n  \
             <version>2.1.0</version>\n  <description>Interfaces for a peer.</description>\n  \
             <maintainer email=\"tractrix@example.org\">Tractrix</maintainer>\n  \
             <license>Apache-2.0</license>\n  \
             <buildtool_depend>ament_cmake</buildtool_depend>\n  \
             <buildtool_depend>rosidl_default_generators</buildtool_depend>\n{depend}  \
             <exec_depend>rosidl_default_runtime</exec_depend>\n  \
             <member_of_group>rosidl_interface_packages</member_of_group>\n  \
             <export><build_type>ament_cmake</build_type></export>\n</package>\n"
        ),
    )?;
    std::fs::write(
        package.join("CMakeLists.txt"),
        format!(
            "cmake_minimum_required(VERSION 3.8)\nproject({name})\n\
             find_package(ament_cmake REQUIRED)\n\
             find_package(rosidl_default_generators REQUIRED)\n{found}\
             rosidl_generate_interfaces(${{PROJECT_NAME}}\n  {}\n  DEPENDENCIES {})\n\
             ament_export_dependencies(rosidl_default_runtime)\nament_package()\n",
            files.join("\n  "),
            needs.join(" "),
        ),
    )
}
