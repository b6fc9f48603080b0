#pragma once
#include <string_view>

/// What the reader does with every element and attribute of MJCF (the grammar of MuJoCo 4.0.1, as mj_printSchema prints it). Whatever
/// stands in no list is unknown and an error. Orientations are `quat axisangle euler xyaxes zaxis`.
namespace gsp::io::detail::mjcf {

struct ElementSchema {
  std::string_view element;
  std::string_view honoured;   // read
  std::string_view visual;     // pictures of MuJoCo's own viewer only
  std::string_view no_effect;  // settings of what this library does in another way, or does not need
  std::string_view refused;    // an error, unless the value is neutral (0, false, none, auto)
  std::string_view children;   // elements that may stand inside
};

inline constexpr std::string_view sensor_tags =
    "touch accelerometer velocimeter gyro force torque magnetometer camprojection rangefinder jointpos jointvel tendonpos tendonvel "
    "actuatorpos actuatorvel actuatorfrc "
    "jointactuatorfrc tendonactuatorfrc ballquat ballangvel jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos tendonlimitvel "
    "tendonlimitfrc framepos framequat "
    "framexaxis frameyaxis framezaxis framelinvel frameangvel framelinacc frameangacc subtreecom subtreelinvel subtreeangmom insidesite "
    "distance normal fromto contact "
    "e_potential e_kinetic clock tactile user";
inline constexpr std::string_view sensor_attributes =
    "cutoff delay interp interval name noise nsample site user camera data joint tendon actuator objname objtype refname reftype body "
    "enclosed body1 body2 geom1 geom2 num "
    "reduce subtree1 subtree2 geom mesh datatype dim needstage";

inline constexpr ElementSchema schema[] = {
    {"mujoco", "model", "", "", "",
     "compiler option size statistic visual default extension asset worldbody deformable contact tendon equality actuator sensor custom "
     "keyframe"},
    {"mujocoinclude", "model", "", "", "",
     "compiler option size statistic visual default extension asset worldbody deformable contact tendon equality actuator sensor custom "
     "keyframe"},
    {"compiler",
     "angle autolimits balanceinertia boundinertia boundmass coordinate eulerseq inertiafromgeom inertiagrouprange settotalmass", "",
     "assetdir conflict fitaabb meshdir passthrough savecanonical savecompiled saveinertial strippath texturedir usethread",
     "alignfree discardvisual fusestatic", "lengthrange"},
    {"lengthrange", "", "", "accel interval inttotal maxforce mode timeconst timestep tolrange useexisting uselimit", "", ""},
    {"option", "cone gravity impratio integrator iterations timestep tolerance", "",
     "ccd_iterations ccd_tolerance jacobian ls_iterations ls_tolerance magnetic noslip_iterations noslip_tolerance o_friction o_margin "
     "o_solimp o_solref sdf_initpoints "
     "sdf_iterations sleep_tolerance solver",
     "actuatorgroupdisable density viscosity wind", "flag"},
    {"flag", "actuation clampctrl constraint contact damper eulerdamp filterparent frictionloss gravity limit refsafe spring warmstart", "",
     "autoreset energy equality fwdinv invdiscrete island midphase multiccd nativeccd sensor sleep", "diagexact ipc override speculative",
     ""},
    {"size", "", "",
     "memory nconmax njmax nkey nstack nuser_actuator nuser_body nuser_cam nuser_geom nuser_jnt nuser_sensor nuser_site nuser_tendon "
     "nuserdata",
     "", ""},
    {"statistic", "", "center extent meaninertia meanmass meansize", "", "", ""},
    {"visual", "", "", "", "", "global quality headlight map scale rgba"},
    {"global", "", "azimuth bvactive cameraid elevation ellipsoidinertia fovy glow ipd linewidth offheight offwidth orthographic realtime",
     "", "", ""},
    {"quality", "", "numquads numslices numstacks offsamples shadowsize", "", "", ""},
    {"headlight", "", "active ambient diffuse specular", "", "", ""},
    {"map", "", "actuatortendon alpha fogend fogstart force haze shadowclip shadowscale stiffness stiffnessrot torque zfar znear", "", "",
     ""},
    {"scale", "",
     "actuatorlength actuatorwidth camera com connect constraint contactheight contactwidth forcewidth framelength framewidth frustum "
     "jointlength jointwidth light selectpoint "
     "slidercrank",
     "", "", ""},
    {"rgba", "",
     "actuator actuatornegative actuatorpositive bv bvactive camera com connect constraint contactforce contactfriction contactgap "
     "contactpoint contacttorque crankbroken fog force "
     "frustum haze inertia joint light rangefinder selectpoint slidercrank",
     "", "", ""},
    {"default", "class", "", "", "",
     "default mesh texture material joint geom site camera light pair equality tendon general motor position velocity intvelocity "
     "orientation pid damper cylinder muscle adhesion "
     "dcmotor"},
    {"custom", "", "", "", "", "numeric text tuple"},
    {"numeric", "", "", "data name size", "", ""},
    {"text", "", "", "data name", "", ""},
    {"tuple", "", "", "name", "", "element"},
    {"element", "", "", "objname objtype prm", "", ""},
    {"asset", "", "", "", "", "mesh hfield skin texture material model"},
    {"mesh", "class file name", "",
     "builtin content_type face inertia material maxhullvert normal params refpos refquat scale smoothnormal texcoord vertex", "",
     "plugin"},
    {"hfield", "name", "", "content_type elevation file ncol nrow size", "", ""},
    {"texture", "",
     "builtin class colorspace content_type embed file fileback filedown filefront fileleft fileright fileup gridlayout gridsize height "
     "hflip mark markrgb name nchannel random rgb1 rgb2 type vflip width",
     "", "", ""},
    {"material", "class name rgba", "emission metallic reflectance roughness shininess specular texrepeat texture texuniform", "", "",
     "layer"},
    {"layer", "", "role texture", "", "", ""},
    {"model", "file name", "", "content_type", "", ""},
    {"worldbody", "", "", "", "", "geom site camera light body frame replicate attach composite flexcomp plugin"},
    {"body", "axisangle childclass euler gravcomp mocap name pos quat xyaxes zaxis", "", "fuse simple sleep user", "",
     "inertial joint freejoint geom site camera light body frame replicate attach composite flexcomp plugin"},
    {"frame", "axisangle childclass euler name pos quat xyaxes zaxis", "", "", "",
     "joint freejoint geom site camera light body frame replicate attach composite flexcomp plugin"},
    {"replicate", "count euler offset sep childclass", "", "", "",
     "joint freejoint geom site camera light body frame replicate attach composite flexcomp plugin"},
    {"attach", "body model prefix", "", "", "frame", ""},
    {"inertial", "axisangle diaginertia euler fullinertia mass pos quat xyaxes zaxis", "", "", "", ""},
    {"joint",
     "actuatorfrclimited actuatorfrcrange armature axis class damping frictionloss group limited margin name pos range ref solimpfriction "
     "solimplimit solreffriction solreflimit "
     "springdamper springref stiffness type",
     "", "user", "actuatorgravcomp springyield", ""},
    {"freejoint", "group name", "", "", "align", ""},
    {"geom",
     "axisangle class conaffinity condim contype density euler friction fromto gap group hfield margin mass material mesh name pos "
     "priority quat rgba shellinertia size solimp solmix "
     "solref type xyaxes zaxis",
     "castshadow", "fitscale fluidcoef user", "adhesion fluidshape surfacevel", "plugin"},
    {"site", "axisangle class euler fromto group name pos quat size type xyaxes zaxis", "material mesh rgba", "user", "", ""},
    {"camera", "axisangle class euler fovy mode name pos quat xyaxes zaxis", "",
     "focal focalpixel ipd output principal principalpixel projection resolution sensorsize target user", "", ""},
    {"light", "",
     "active ambient attenuation bulbradius castshadow class cutoff diffuse dir directional exponent intensity mode name pos range "
     "softness specular target texture type",
     "", "", ""},
    {"contact", "", "", "", "", "pair exclude"},
    {"exclude", "body1 body2 name", "", "", "", ""},
    {"tendon", "", "", "", "", "fixed spatial"},
    {"fixed",
     "actuatorfrclimited armature class damping frictionloss limited margin name range solimpfriction solimplimit solreffriction "
     "solreflimit springlength stiffness",
     "material rgba width", "group user", "actuatorfrcrange springyield", "joint"},
    {"actuator", "", "", "", "",
     "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin"},
    {"general",
     "biasprm biastype class ctrllimited ctrlrange dyntype forcelimited forcerange gainprm gaintype gear group inheritrange joint "
     "jointinparent name tendon",
     "", "actdim actearly actlimited actrange dynprm interp lengthrange user",
     "armature body cranklength cranksite damping delay ffrange input nsample refsite site slidersite velrange", ""},
    {"motor", "class ctrllimited ctrlrange forcelimited forcerange gear group joint jointinparent name tendon", "",
     "interp lengthrange user", "armature cranklength cranksite damping delay nsample refsite site slidersite", ""},
    {"position",
     "class ctrllimited ctrlrange dampratio forcelimited forcerange gear group inheritrange joint jointinparent kp kv name tendon", "",
     "interp lengthrange user", "armature cranklength cranksite damping delay nsample refsite site slidersite timeconst", ""},
    {"velocity", "class ctrllimited ctrlrange forcelimited forcerange gear group joint jointinparent kv name tendon", "",
     "interp lengthrange user", "armature cranklength cranksite damping delay nsample refsite site slidersite", ""},
    {"keyframe", "", "", "", "", "key"},
    {"key", "ctrl name qpos qvel time", "", "", "act mpos mquat plastic", ""},
};

/// Whether `word` is one of the blank-separated words of `list`.
constexpr bool is_in(std::string_view list, std::string_view word) {
  if (word.empty()) return false;
  for (std::size_t at = list.find(word); at != std::string_view::npos; at = list.find(word, at + 1)) {
    bool const starts = at == 0 || list[at - 1] == ' ', ends = at + word.size() == list.size() || list[at + word.size()] == ' ';
    if (starts && ends) return true;
  }
  return false;
}
constexpr ElementSchema const* find_schema(std::string_view element) {
  for (auto const& e : schema)
    if (e.element == element) return &e;
  return nullptr;
}

}  // namespace gsp::io::detail::mjcf
