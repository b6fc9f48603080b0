#pragma once
// Three robots in URDF, written by hand, whose numbers can be checked on paper.
#include <string>

namespace gsp_test {

/// Fixed base, two revolute joints, a wrist, and a gripper whose right finger mimics the left.
inline std::string urdf_arm() {
  return R"(<?xml version="1.0"?>
<robot name="arm">
  <material name="steel"><color rgba="0.6 0.6 0.7 1"/></material>
  <link name="base">
    <inertial><origin xyz="0 0 0.05"/><mass value="4"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial>
    <visual><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.1" length="0.1"/></geometry><material name="steel"/></visual>
    <collision name="foot"><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.1" length="0.1"/></geometry></collision>
  </link>
  <link name="upper">
    <inertial><origin xyz="0 0.01 0.15" rpy="0 0 0.5"/><mass value="2"/><inertia ixx="0.02" ixy="-0.01" ixz="0" iyy="0.02" iyz="0" izz="0.035"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><capsule radius="0.04" length="0.3"/></geometry></collision>
  </link>
  <link name="fore">
    <inertial><origin xyz="0 0 0.1"/><mass value="1.5"/><inertia ixx="0.01" ixy="0.001" ixz="0.002" iyy="0.012" iyz="0.003" izz="0.008"/></inertial>
    <visual><geometry><box size="0.06 0.08 0.2"/></geometry><material name="red"><color rgba="1 0 0 0.5"/></material></visual>
    <collision><geometry><box size="0.06 0.08 0.2"/></geometry></collision>
  </link>
  <link name="tool"/>
  <link name="left"><inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
    <collision><geometry><box size="0.01 0.02 0.04"/></geometry></collision></link>
  <link name="right"><inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
    <collision><geometry><box size="0.01 0.02 0.04"/></geometry></collision></link>
  <joint name="pan" type="revolute"><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/><parent link="base"/><child link="upper"/><axis xyz="0 0 2"/>
    <limit lower="-2.5" upper="2.5" effort="40" velocity="2"/><dynamics damping="0.5" friction="0.2"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0 0 0.3" rpy="1.5707963267948966 0.3 0"/><parent link="upper"/><child link="fore"/><axis xyz="0 3 4"/>
    <limit lower="0" upper="2" effort="20" velocity="2"/></joint>
  <joint name="flange" type="fixed"><origin xyz="0 0 0.2"/><parent link="fore"/><child link="tool"/></joint>
  <joint name="finger" type="prismatic"><origin xyz="0 0.02 0"/><parent link="tool"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.1"/></joint>
  <joint name="other_finger" type="prismatic"><origin xyz="0 -0.02 0"/><parent link="tool"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.05" effort="10" velocity="0.1"/><mimic joint="finger" multiplier="1.25" offset="0.001"/></joint>
  <transmission name="t1"><type>transmission_interface/SimpleTransmission</type><joint name="pan"/></transmission>
</robot>)";
}

/// A trunk on four legs of three joints, a foot fixed to each shin.
inline std::string urdf_quadruped() {
  std::string text = R"(<robot name="quadruped">
  <link name="trunk"><inertial><mass value="6"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.22"/></inertial>
    <collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision></link>
  <gazebo reference="trunk"><mu1>0.6</mu1></gazebo>)";
  for (char const* leg : {"fl", "fr", "rl", "rr"}) {
    std::string const n = leg, x = leg[0] == 'f' ? "0.2" : "-0.2", y = leg[1] == 'l' ? "0.1" : "-0.1",
                      y2 = leg[1] == 'l' ? "0.05" : "-0.05";
    auto const link = [&](char const* name, char const* mass, char const* com) {
      return "<link name='" + n + "_" + name + "'><inertial><origin xyz='" + com + "'/><mass value='" + mass +
             "'/><inertia ixx='0.002' ixy='0' ixz='0' iyy='0.002' iyz='0' izz='0.0005'/></inertial>"
             "<collision><origin xyz='0 0 -0.1'/><geometry><cylinder radius='0.02' length='0.2'/></geometry></collision></link>\n";
    };
    auto const joint = [&](char const* name, std::string const& parent, char const* child, std::string const& xyz, char const* axis,
                           char const* range) {
      return "<joint name='" + n + "_" + name + "_joint' type='revolute'><origin xyz='" + xyz + "'/><parent link='" + parent +
             "'/><child link='" + n + "_" + child + "'/><axis xyz='" + axis + "'/><limit " + range +
             " effort='23.7' velocity='30'/><dynamics damping='0.01' friction='0.1'/></joint>\n";
    };
    text += link("hip", "0.5", "0 0 0") + link("thigh", "0.9", "0 0 -0.05") + link("shin", "0.2", "0 0 -0.1") + "<link name='" + n +
            "_foot'><collision><geometry><sphere radius='0.022'/></geometry></collision></link>\n";
    text += joint("hip", "trunk", "hip", x + " " + y + " 0", "1 0 0", "lower='-0.8' upper='0.8'") +
            joint("thigh", n + "_hip", "thigh", "0 " + y2 + " 0", "0 1 0", "lower='-1.5' upper='3.4'") +
            joint("shin", n + "_thigh", "shin", "0 0 -0.2", "0 1 0", "lower='-2.7' upper='-0.8'") + "<joint name='" + n +
            "_foot_joint' type='fixed'><origin xyz='0 0 -0.2'/><parent link='" + n + "_shin'/><child link='" + n + "_foot'/></joint>\n";
  }
  return text + "</robot>";
}

/// Two driven wheels, a caster, a mast that slides, on a root link that has neither mass nor shape.
inline std::string urdf_wheels() {
  return R"(<robot name="wheels">
  <link name="footprint"/>
  <link name="base"><inertial><origin xyz="0.02 0 0"/><mass value="10"/><inertia ixx="0.3" ixy="0" ixz="0" iyy="0.4" iyz="0" izz="0.5"/></inertial>
    <collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision></link>
  <link name="left_wheel"><inertial><mass value="1"/><inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.005"/></inertial>
    <collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>
  <link name="right_wheel"><inertial><mass value="1"/><inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.005"/></inertial>
    <collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>
  <link name="caster"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="mast"><inertial><origin xyz="0 0 0.2"/><mass value="0.8"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.001"/></inertial>
    <visual><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.02" length="0.4"/></geometry></visual></link>
  <joint name="base_joint" type="fixed"><parent link="footprint"/><child link="base"/><origin xyz="0 0 0.12"/></joint>
  <joint name="left" type="continuous"><parent link="base"/><child link="left_wheel"/><origin xyz="0.1 0.17 -0.02" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
    <limit effort="5" velocity="20"/><dynamics damping="0.02"/></joint>
  <joint name="right" type="continuous"><parent link="base"/><child link="right_wheel"/><origin xyz="0.1 -0.17 -0.02" rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
    <limit effort="5" velocity="20"/><dynamics damping="0.02"/></joint>
  <joint name="caster_joint" type="fixed"><parent link="base"/><child link="caster"/><origin xyz="-0.2 0 -0.07"/></joint>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="mast"/><origin xyz="-0.1 0 0.05"/><axis xyz="0 0 1"/>
    <limit lower="-0.05" upper="0.3" effort="100" velocity="1"/></joint>
  <ros2_control name="c" type="system"><joint name="left"><command_interface name="velocity"/></joint></ros2_control>
</robot>)";
}

}  // namespace gsp_test
