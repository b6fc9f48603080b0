#pragma once
#include <string_view>

/// What the reader does with every element and attribute of MJCF (the grammar of MuJoCo 4.0.1, as mj_printSchema prints it). Whatever
/// stands in no list is unknown and an error. docs/io/what_of_mjcf_works.md is printed from this table (gsp info --schema).
namespace gsp::io::detail::mjcf {

struct ElementSchema {
  std::string_view element;    // "in/element" where the same name means something else elsewhere
  std::string_view honoured;   // read
  std::string_view visual;     // pictures of MuJoCo's own viewer only
  std::string_view no_effect;  // settings of what this library does in another way, or does not need
  std::string_view refused;    // an error, unless the value is neutral (0, false, none, auto)
  std::string_view children;   // elements that may stand inside
};
/// Attributes that many elements have: a word @NAME of a list stands for these.
struct AttributeGroup {
  std::string_view name, words;
};
inline constexpr AttributeGroup attribute_groups[] = {
    {"@turn", "axisangle euler quat xyaxes zaxis"},
    {"@limits", "erplimit hardlimit restitutionlimit solimpfriction solimplimit solreffriction solreflimit"},
    {"@actuator", "class forcelimited forcerange group name"},
    {"@length", "armature cranklength cranksite ctrllimited ctrlrange damping gear joint jointinparent lengthrange slidersite tendon"},
    {"@transmission", "refsite site @length"},
    {"@tendon",
     "actuatorfrclimited actuatorfrcrange armature class damping frictionloss limited margin name range springlength stiffness @limits"},
    {"@sensor", "cutoff name noise"},
    {"@history", "delay interp interval nsample"},
    {"@world", "body frame replicate attach geom site camera light composite flexcomp plugin"},
    {"@sections",
     "compiler option size statistic visual default extension asset worldbody deformable contact tendon equality actuator sensor custom "
     "keyframe body"},
};

/// Elements that are refused by name, and why.
struct RefusedElement {
  std::string_view element, sentence;
};
inline constexpr RefusedElement refused_elements[] = {
    {"extension", "plug-ins are not supported; remove them"},
    {"plugin", "plug-ins are not supported; remove it"},
    {"composite", "composites are not supported (MuJoCo 4 has none either); write the bodies out"},
    {"flexcomp", "flexes are not supported; remove it"},
    {"flex", "flexes are not supported; remove it"},
    {"flexvert", "flexes are not supported; remove it"},
    {"flexstrain", "flexes are not supported; remove it"},
    {"orientation", "actuators with several controls are not supported; use position on each axis"},
    {"pid", "actuators with an integral term are not supported; use position"},
    {"dcmotor", "models of electric motors are not supported; use motor, position or general"},
};

inline constexpr ElementSchema schema[] = {
    {"mujoco", "model", "", "", "", "@sections"},
    {"mujocoinclude", "model", "", "", "", "@sections"},
    {"compiler",
     "alignfree angle assetdir autolimits balanceinertia boundinertia boundmass coordinate discardvisual eulerseq fitaabb fusestatic "
     "inertiafromgeom inertiagrouprange meshdir settotalmass strippath",
     "texturedir", "conflict passthrough savecanonical savecompiled saveinertial usethread", "", "lengthrange"},
    {"lengthrange", "accel interval inttotal maxforce mode timeconst timestep tolrange useexisting uselimit", "", "", "", ""},
    {"option",
     "actuatorgroupdisable cone density gravity impratio integrator iterations magnetic noslip_iterations noslip_tolerance o_friction "
     "o_margin o_solimp o_solref sleep_tolerance timestep tolerance viscosity wind",
     "", "ccd_iterations ccd_tolerance jacobian ls_iterations ls_tolerance sdf_initpoints sdf_iterations solver", "", "flag"},
    {"flag",
     "actuation clampctrl constraint contact damper equality eulerdamp filterparent frictionloss gravity limit override refsafe sleep "
     "spring "
     "warmstart",
     "", "autoreset energy fwdinv invdiscrete island midphase multiccd nativeccd sensor", "diagexact ipc speculative", ""},
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
     "jointlength jointwidth light selectpoint slidercrank",
     "", "", ""},
    {"rgba", "",
     "actuator actuatornegative actuatorpositive bv bvactive camera com connect constraint contactforce contactfriction contactgap "
     "contactpoint contacttorque crankbroken fog force frustum haze inertia joint light rangefinder selectpoint slidercrank",
     "", "", ""},
    {"default", "class", "", "", "",
     "default mesh texture material joint geom site camera light pair equality tendon general motor position velocity intvelocity "
     "orientation pid damper cylinder muscle adhesion dcmotor"},
    {"custom", "", "", "", "", "numeric text tuple"},
    {"numeric", "", "", "data name size", "", ""},
    {"text", "", "", "data name", "", ""},
    {"tuple", "", "", "name", "", "element"},
    {"element", "", "", "objname objtype prm", "", ""},
    {"asset", "", "", "", "", "mesh hfield skin texture material model"},
    {"mesh", "builtin class face file inertia maxhullvert name params refpos refquat scale vertex", "material normal smoothnormal texcoord",
     "content_type", "", "plugin"},
    {"hfield", "content_type elevation file name ncol nrow size", "", "", "", ""},
    {"deformable", "", "", "", "", "flex skin"},
    {"skin", "", "face file group inflate material name rgba texcoord vertex", "", "", "bone"},
    {"bone", "", "bindpos bindquat body vertid vertweight", "", "", ""},
    {"texture", "",
     "builtin class colorspace content_type embed file fileback filedown filefront fileleft fileright fileup gridlayout gridsize height "
     "hflip mark markrgb name nchannel random rgb1 rgb2 type vflip width",
     "", "", ""},
    {"material", "class name rgba", "emission metallic reflectance roughness shininess specular texrepeat texture texuniform", "", "",
     "layer"},
    {"layer", "", "role texture", "", "", ""},
    {"model", "file name", "", "content_type", "", ""},
    {"worldbody", "", "", "", "", "@world"},
    {"body", "childclass fuse gravcomp mocap name pos sleep @turn", "", "simple user", "", "inertial joint freejoint @world"},
    {"frame", "childclass name pos @turn", "", "", "massscale scale scaling", "joint freejoint @world"},
    {"replicate", "childclass count euler offset sep", "", "", "", "joint freejoint @world"},
    {"attach", "body model prefix", "", "", "frame", ""},
    {"inertial", "diaginertia fullinertia mass pos @turn", "", "", "", ""},
    {"joint",
     "actuatorfrclimited actuatorfrcrange actuatorgravcomp armature axis class damping frictionloss group limited margin name pos range "
     "ref springdamper springref stiffness type @limits",
     "", "user", "springyield", ""},
    {"freejoint", "align group name", "", "", "", ""},
    {"geom",
     "adhesion class conaffinity condim contype density erp fitscale fluidcoef fluidshape friction fromto gap group hard hfield margin "
     "mass "
     "material mesh name pos priority restitution rgba shellinertia size solimp solmix solref surfacevel type _bounciness _erp _hard @turn",
     "castshadow", "user", "", "plugin"},
    {"site", "class fromto group name pos size type @turn", "material mesh rgba", "user", "", ""},
    {"camera", "class focal focalpixel fovy mode name pos principal principalpixel projection resolution sensorsize target @turn",
     "ipd output", "user", "", ""},
    {"light", "",
     "active ambient attenuation bulbradius castshadow class cutoff diffuse dir directional exponent intensity mode name pos range "
     "softness specular target texture type",
     "", "", ""},
    {"contact", "", "", "", "", "pair exclude"},
    {"pair", "adhesion class condim erp friction gap geom1 geom2 hard margin name restitution solimp solref solreffriction", "", "", "",
     ""},
    {"exclude", "body1 body2 name", "", "", "", ""},
    {"equality", "", "", "", "", "connect weld joint tendon flex flexvert flexstrain"},
    {"default/equality", "active erp hard solimp solref", "", "", "", ""},
    {"equality/connect", "active anchor body1 body2 class erp hard name site1 site2 solimp solref", "", "", "", ""},
    {"equality/weld", "active anchor body1 body2 class erp hard name relpose site1 site2 solimp solref torquescale", "", "", "", ""},
    {"equality/joint", "active class erp hard joint1 joint2 name polycoef solimp solref", "", "", "", ""},
    {"equality/tendon", "active class erp hard name polycoef solimp solref tendon1 tendon2", "", "", "", ""},
    {"tendon", "", "", "", "", "fixed spatial"},
    {"fixed", "@tendon", "", "group user", "springyield", "joint"},
    {"fixed/joint", "coef joint", "", "", "", ""},
    {"spatial", "@tendon", "material rgba width", "group user", "springyield", "site geom pulley"},
    {"spatial/site", "site", "", "", "", ""},
    {"spatial/geom", "geom sidesite", "", "", "", ""},
    {"spatial/pulley", "divisor", "", "", "", ""},
    {"actuator", "", "", "", "",
     "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin"},
    {"general",
     "actdim actearly actlimited actrange biasprm biastype body dynprm dyntype gainprm gaintype inheritrange @actuator @transmission", "",
     "input interp user", "delay ffrange nsample velrange", ""},
    {"motor", "@actuator @transmission", "", "interp user", "delay nsample", ""},
    {"position", "dampratio inheritrange kp kv timeconst @actuator @transmission", "", "interp user", "delay nsample", ""},
    {"velocity", "kv @actuator @transmission", "", "interp user", "delay nsample", ""},
    {"intvelocity", "actlimited actrange dampratio inheritrange kp kv @actuator @transmission", "", "interp user", "delay nsample", ""},
    {"damper", "kv @actuator @transmission", "", "interp user", "delay nsample", ""},
    {"cylinder", "area bias diameter timeconst @actuator @transmission", "", "interp user", "delay nsample", ""},
    {"muscle", "force fpmax fvmax lmax lmin range scale tausmooth timeconst vmax @actuator @length", "", "interp user", "delay nsample",
     ""},
    {"adhesion", "body ctrlrange gain @actuator", "", "interp user", "delay nsample", ""},
    {"sensor/touch", "site @sensor @history", "", "user", "", ""},
    {"sensor/accelerometer", "site @sensor @history", "", "user", "", ""},
    {"sensor/velocimeter", "site @sensor @history", "", "user", "", ""},
    {"sensor/gyro", "site @sensor @history", "", "user", "", ""},
    {"sensor/force", "site @sensor @history", "", "user", "", ""},
    {"sensor/torque", "site @sensor @history", "", "user", "", ""},
    {"sensor/magnetometer", "site @sensor @history", "", "user", "", ""},
    {"sensor/camprojection", "camera site @sensor @history", "", "user", "", ""},
    {"sensor/rangefinder", "camera data site @sensor @history", "", "user", "", ""},
    {"sensor/jointpos", "joint @sensor @history", "", "user", "", ""},
    {"sensor/jointvel", "joint @sensor @history", "", "user", "", ""},
    {"sensor/tendonpos", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/tendonvel", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/actuatorpos", "actuator @sensor @history", "", "user", "", ""},
    {"sensor/actuatorvel", "actuator @sensor @history", "", "user", "", ""},
    {"sensor/actuatorfrc", "actuator @sensor @history", "", "user", "", ""},
    {"sensor/jointactuatorfrc", "joint @sensor @history", "", "user", "", ""},
    {"sensor/tendonactuatorfrc", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/ballquat", "joint @sensor @history", "", "user", "", ""},
    {"sensor/ballangvel", "joint @sensor @history", "", "user", "", ""},
    {"sensor/jointlimitpos", "joint @sensor @history", "", "user", "", ""},
    {"sensor/jointlimitvel", "joint @sensor @history", "", "user", "", ""},
    {"sensor/jointlimitfrc", "joint @sensor @history", "", "user", "", ""},
    {"sensor/tendonlimitpos", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/tendonlimitvel", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/tendonlimitfrc", "tendon @sensor @history", "", "user", "", ""},
    {"sensor/framepos", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/framequat", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/framexaxis", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/frameyaxis", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/framezaxis", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/framelinvel", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/frameangvel", "objname objtype refname reftype @sensor @history", "", "user", "", ""},
    {"sensor/framelinacc", "objname objtype @sensor @history", "", "user", "", ""},
    {"sensor/frameangacc", "objname objtype @sensor @history", "", "user", "", ""},
    {"sensor/subtreecom", "body @sensor @history", "", "user", "", ""},
    {"sensor/subtreelinvel", "body @sensor @history", "", "user", "", ""},
    {"sensor/subtreeangmom", "body @sensor @history", "", "user", "", ""},
    {"sensor/insidesite", "enclosed objname objtype site @sensor @history", "", "user", "", ""},
    {"sensor/distance", "body1 body2 geom1 geom2 @sensor @history", "", "user", "", ""},
    {"sensor/normal", "body1 body2 geom1 geom2 @sensor @history", "", "user", "", ""},
    {"sensor/fromto", "body1 body2 geom1 geom2 @sensor @history", "", "user", "", ""},
    {"sensor/contact", "body1 body2 data geom1 geom2 num reduce site subtree1 subtree2 @sensor @history", "", "user", "", ""},
    {"sensor/e_potential", "@sensor @history", "", "user", "", ""},
    {"sensor/e_kinetic", "@sensor @history", "", "user", "", ""},
    {"sensor/clock", "@sensor @history", "", "user", "", ""},
    {"sensor/tactile", "cutoff geom mesh name @history", "", "user", "", ""},
    {"sensor/user", "datatype dim needstage objname objtype @sensor", "", "user", "", ""},
    {"keyframe", "", "", "", "", "key"},
    {"key", "act ctrl mpos mquat name qpos qvel time", "", "", "plastic", ""},
};

/// Whether `word` is one of the blank-separated words of `list`, groups expanded.
constexpr bool is_in(std::string_view list, std::string_view word) {
  if (word.empty()) return false;
  for (std::size_t at = 0; at < list.size();) {
    std::size_t end = list.find(' ', at);
    if (end == std::string_view::npos) end = list.size();
    auto const one = list.substr(at, end - at);
    if (one == word) return true;
    if (!one.empty() && one[0] == '@')
      for (auto const& group : attribute_groups)
        if (group.name == one && is_in(group.words, word)) return true;
    at = end + 1;
  }
  return false;
}
constexpr ElementSchema const* find_schema(std::string_view element) {
  for (auto const& e : schema)
    if (e.element == element) return &e;
  return nullptr;
}
constexpr RefusedElement const* find_refused(std::string_view element) {
  for (auto const& e : refused_elements)
    if (e.element == element) return &e;
  return nullptr;
}

}  // namespace gsp::io::detail::mjcf
