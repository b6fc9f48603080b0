#pragma once

namespace gsp_test {

/// A model of what the zoo has not: mocap, gravity compensation in both ways, polynomials, all transmissions, armature and limits of
/// spatial tendons that cross trees, a fluid with wind.
inline char const* const everything = R"(
<mujoco>
  <option density="1.2" viscosity="0.02" wind="1 -0.5 0.3" timestep="0.003" actuatorgroupdisable="3"/>
  <default><site size="0.01"/></default>
  <worldbody>
    <site name="ground" pos="0.3 0.2 1.5"/>
    <body name="still" pos="0.5 0 0.2" euler="10 20 30"><site name="post" pos="0 0.1 0.4" euler="5 6 7"/><geom name="wheel" type="cylinder" size="0.06 0.1" pos="-0.2 0.1 0.7" euler="90 0 20" mass="1"/></body>
    <body name="hand" mocap="true" pos="0 0.4 1" euler="10 0 0">
      <geom type="box" size="0.05 0.05 0.05"/><site name="palm" pos="0 0 0.1"/>
      <body name="finger" pos="0.1 0 0" euler="0 40 0">
        <geom type="sphere" size="0.03" pos="0 0 0.1"/><site name="tip" pos="0 0 0.15" euler="30 0 0"/>
      </body>
    </body>
    <body name="base" pos="0 0 1">
      <joint name="yaw" axis="0 0 1" damping="0.3 0.2 0.1" stiffness="2 1 3" springref="20" armature="0.01"/>
      <geom name="trunk" type="capsule" size="0.05 0.2" mass="1"/><site name="shoulder" pos="0 0.1 0.2" euler="20 30 40"/>
      <body name="arm" pos="0 0 0.25" gravcomp="0.7">
        <joint name="socket" type="ball" stiffness="1 0.5 0.2" damping="0.1 0.05"/>
        <geom name="upper" type="capsule" size="0.03 0.15" pos="0 0 0.15" mass="0.5" fluidshape="ellipsoid"/><site name="elbow_site" pos="0.03 0 0.3" euler="10 20 30"/>
        <body name="forearm" pos="0 0 0.3" gravcomp="1">
          <joint name="elbow" axis="0 1 0" actuatorgravcomp="true" actuatorfrcrange="-2 2" damping="0.2"/>
          <joint name="slide" type="slide" axis="0 0 1" stiffness="50" actuatorgravcomp="true"/>
          <geom name="lower" type="ellipsoid" size="0.04 0.03 0.15" pos="0 0 0.15" mass="0.4" fluidshape="ellipsoid" fluidcoef="0.4 0.3 1.2 0.9 0.8"/>
          <site name="wrist" pos="0 0.02 0.3" euler="40 50 60"/><geom name="knob" type="sphere" size="0.04" pos="0.05 0 0.02" mass="0.1"/>
          <site name="knob_side" pos="0.1 0 0.02"/>
        </body>
      </body>
    </body>
    <body name="ball1" pos="1 0 1"><freejoint name="f1"/><geom type="ellipsoid" size="0.1 0.07 0.05" density="300" fluidshape="ellipsoid"/><site name="b1" pos="0.05 0 0.03" euler="30 0 10"/></body>
    <body name="between" pos="2 2 2"><geom type="sphere" size="0.1"/></body>
    <body name="ball2" pos="1 1 1"><joint name="f2" type="free" damping="0.02" stiffness="1"/><geom type="box" size="0.1 0.07 0.05" density="300"/><site name="b2" pos="0 0.05 0.03"/></body>
    <body name="lone" pos="-1 1 1"><freejoint/><geom type="ellipsoid" size="0.1 0.2 0.05" density="100" fluidshape="ellipsoid"/></body>
    <body name="crank" pos="-1 0 1"><joint name="crank" axis="0 1 0"/><geom type="box" size="0.1 0.02 0.02" mass="0.3"/><site name="pin" pos="0.1 0 0"/></body>
    <body name="piston" pos="-0.5 0 1"><joint name="piston" type="slide" axis="1 0 0"/><geom type="box" size="0.05 0.03 0.03" mass="0.3"/><site name="slot" euler="0 -90 0"/></body>
    <body name="held" mocap="true" pos="-1 -1 1"><site name="hook"/></body>
    <camera name="c1" pos="1 1 1" mode="targetbody" target="forearm"/><camera name="c2" pos="1 1 2" mode="targetbodycom" target="base"/>
    <camera name="c3" pos="1 0 2" euler="10 20 30" resolution="64 48"/><camera name="c4" sensorsize=".004 .003" focalpixel="150 170" resolution="320 200"/>
  </worldbody>
  <tendon>
    <spatial name="strings" armature="0.05" stiffness="20 5 3" damping="0.4 0.2 0.1" springlength="0.3 0.5"><site site="ground"/><site site="elbow_site"/><site site="wrist"/><pulley divisor="2"/><site site="palm"/><site site="wrist"/><site site="post"/></spatial>
    <spatial name="across" stiffness="10" damping="0.3" armature="0.02"><site site="b1"/><site site="b2"/></spatial>
    <spatial name="round" stiffness="15" actuatorfrcrange="-3 3"><site site="shoulder"/><geom geom="knob" sidesite="knob_side"/><site site="wrist"/><site site="tip"/></spatial>
    <spatial name="wheels" damping="1"><site site="ground"/><geom geom="wheel"/><site site="wrist"/></spatial>
    <fixed name="sum" armature="0.03" stiffness="3" damping="0.1"><joint joint="elbow" coef="1.5"/><joint joint="slide" coef="-2"/><joint joint="crank" coef="0.5"/></fixed>
  </tendon>
  <actuator>
    <motor joint="yaw" gear="3"/>
    <position joint="elbow" kp="20" kv="2" forcerange="-3 3"/>
    <general joint="slide" dyntype="filterexact" dynprm="0.05" gainprm="5" actearly="true" actlimited="true" actrange="-0.5 0.5" damping="0.4" armature="0.02" gear="1.5"/>
    <intvelocity joint="crank" kp="8" actrange="-1 1"/>
    <muscle name="muscle" tendon="round" lengthrange="0.2 0.9" force="30"/>
    <muscle tendon="strings" lengthrange="0.2 1.5" timeconst="0.02 0.05" tausmooth="0.3"/>
    <general tendon="across" gaintype="affine" gainprm="1 2 -3" biastype="affine" biasprm="0.2 -1 -0.5" armature="0.01" damping="0.2" gear="0.7"/>
    <position tendon="round" kp="40"/>
    <position joint="socket" kp="3" kv="0.2" gear="0.3 0.5 0.7" ctrlrange="-9 9"/>
    <motor jointinparent="socket" gear="0.3 -0.5 0.7"/>
    <motor joint="f1" gear="1 2 3 0.1 0.2 0.3"/>
    <motor jointinparent="f2" gear="1 2 3 0.1 0.2 0.3"/>
    <motor site="wrist" gear="1 2 3 0.4 0.5 0.6"/>
    <position site="wrist" refsite="shoulder" gear="0.5 0.6 0.7 0 0 0" kp="4" kv="0.3"/>
    <position site="wrist" refsite="shoulder" gear="0 0 0 0.5 0.6 0.7" kp="4" kv="0.3" ctrlrange="-9 9"/>
    <position site="b2" refsite="palm" gear="0.5 0.6 0.7 0.1 0.2 0.3" kp="4"/>
    <position cranksite="pin" slidersite="slot" cranklength="0.8" kp="5" kv="0.4"/>
    <adhesion body="ball1" ctrlrange="0 1" gain="3"/>
    <damper joint="piston" kv="3" ctrlrange="0 2"/>
    <cylinder joint="piston" area="2" timeconst="0.1" bias="0.1 -1 -0.2"/>
    <motor joint="piston" group="3" gear="7"/>
  </actuator>
</mujoco>)";

}  // namespace gsp_test
