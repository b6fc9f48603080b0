"""What to take here for names of MuJoCo's that a gsp.Model, a gsp.Data or the package has not: asked when a name is missing."""

from __future__ import annotations

import difflib

from . import _gsp

_OPT = (
    "model.timestep and model.gravity; timestep, iterations and tolerance are options of gsp.Data, flags of "
    "gsp.Model.from_xml(..., disable=[...])"
)
_COLOUR = "colours are taken by gsp.Scene(model).add_surface()"
_TURNED = "docs/python.md, 'Points and velocities', turns points and axes of bodies by data.xquat"

MODEL = {
    "opt": _OPT,
    "stat": "sums of model.body_mass; scene.bounds(share) says how far a gsp.Scene of Gaussians goes",
    "vis": "cameras, width and height are given to gsp.Renderer",
    "key_ctrl": "gsp.reset(model, data, keyframe=...) writes it to data.ctrl",
    "key_qvel": "gsp.reset(model, data, keyframe=...) writes it to data.qvel",
    "key_act": "gsp.reset(model, data, keyframe=...) writes it to data.act",
    "key_time": "time begins at 0, whatever the keyframe says",
    "geom_rgba": _COLOUR,
    "mat_rgba": _COLOUR,
    "site_rgba": "sites are not drawn",
    "jnt_limited": "model.jnt_range, 0, 0 where a joint has no range (one that limited='false' takes back is still there)",
    "actuator_ctrllimited": "act_ctrlrange of per_world, -inf to inf where there is no limit: gsp.Data(model, per_world=['act_ctrlrange']), "
    "then data.values('act_ctrlrange')",
    "actuator_gainprm": "act_gain of per_world: gsp.Data(model, per_world=['act_gain']), then data.values('act_gain')",
    "actuator_biasprm": "act_bias of per_world: gsp.Data(model, per_world=['act_bias']), then data.values('act_bias')",
    "actuator_forcerange": "act_forcerange of per_world: gsp.Data(model, per_world=['act_forcerange']), "
    "then data.values('act_forcerange')",
    "cam_pos": "data.cameras([name], width, height) has what Renderer.render takes, of all worlds",
    "body_subtreemass": "sums of model.body_mass by model.body_parentid",
}
for _field in ("cam_quat", "cam_fovy", "cam_bodyid"):
    MODEL[_field] = MODEL["cam_pos"]

DATA = {
    "site_xpos": "data.xpos[:, b] + turn(data.xquat[:, b], model.site_pos[i]) with b = model.site_bodyid[i]: " + _TURNED,
    "geom_xpos": "data.xpos[:, b] + turn(data.xquat[:, b], model.geom_pos[i]) with b = model.geom_bodyid[i]: " + _TURNED,
    "xipos": "data.xpos + turn(data.xquat, model.body_ipos): " + _TURNED,
    "xmat": "data.xquat: the columns of xmat are the axes turned by it, which docs/python.md, 'Points and velocities', has",
    "cam_xpos": "data.cameras([name], width, height) has what Renderer.render takes, of all worlds",
    "xfrc_applied": "data.qfrc_applied = np.einsum('wij,wi->wj', data.jacobian(body=b, point=p), f), f (worlds, 6) force and torque, "
    "before each step",
    "qacc": "(data.qvel - before) / data.timestep of a step; data.qacc_smooth is without constraints",
    "qacc_warmstart": "data.save() has all that the next step starts from",
    "cvel": "data.jacobian(body=b) times data.qvel: velocity, then angular velocity, in world axes",
    "subtree_com": "<subtreecom> in data.sensordata",
    "subtree_linvel": "<subtreelinvel> in data.sensordata",
    "subtree_angmom": "<subtreeangmom> in data.sensordata",
    "actuator_force": "<actuatorfrc> in data.sensordata, or data.qfrc_actuator",
    "actuator_length": "<actuatorpos> in data.sensordata",
    "actuator_velocity": "<actuatorvel> in data.sensordata",
    "ten_length": "<tendonpos> in data.sensordata",
    "ten_velocity": "<tendonvel> in data.sensordata",
    "cfrc_ext": "data.contacts has each contact's force",
    "contact": "data.contacts, of all worlds: world, geom1, geom2, dist, pos, frame, force",
    "ncon": "len(data.contacts), of all worlds; data.contacts.world says whose they are",
    "nefc": "data.counts.rows",
    "qM": "data.mass_matrix()",
    "M": "data.mass_matrix()",
    "qfrc_inverse": "data.inverse(qacc)",
    "energy": "<e_potential> and <e_kinetic> in data.sensordata",
    "solver_niter": "data.counts.iterations",
    "warning": "data.status, and gsp.status_text of it",
    "opt": "data.timestep; options are given to gsp.Data as it is made",
}
for _name in ("site_xmat", "site_xquat"):
    DATA[_name] = "data.xquat[:, model.site_bodyid[i]] and model.site_quat[i]: " + _TURNED
for _name in ("geom_xmat", "geom_xquat"):
    DATA[_name] = "data.xquat[:, model.geom_bodyid[i]] and model.geom_quat[i]: " + _TURNED
for _name in ("cam_xmat", "ximat"):
    DATA[_name] = DATA["cam_xpos"] if _name == "cam_xmat" else DATA["xmat"]

_KINDS = {kind: kind for kind in "body joint geom site camera actuator tendon equality sensor keyframe mesh".split()}
_KINDS |= {"jnt": "joint", "cam": "camera", "ten": "tendon", "eq": "equality", "key": "keyframe"}
_WHERE = {
    "body": "data.xpos[:, i]",
    "joint": "data.qpos[:, model.jnt_qposadr[i]]",
    "actuator": "data.ctrl[:, i]",
    "sensor": "data.sensordata[:, model.sensor_adr[i] :][:, : model.sensor_dim[i]]",
}

PACKAGE = {
    "MjModel": "gsp.Model.from_xml(path) or from_string(text)",
    "MjData": "gsp.Data(model, worlds=n)",
    "mj_step": "gsp.step(model, data, n)",
    "mj_forward": "nothing: what you ask of data is of the state as it is; gsp.forward(model, data) brings views up to date that you hold",
    "mj_resetData": "gsp.reset(model, data, mask=...)",
    "mj_resetDataKeyframe": "gsp.reset(model, data, keyframe=...)",
    "mj_name2id": "model.id('body', name)",
    "MjSpec": "gsp.Model.from_string(spec.to_xml())",
    "mj_id2name": "model.names('body')[i]",
    "mj_jac": "data.jacobian(body=b, point=p), p in the body's frame",
    "mj_jacBody": "data.jacobian(body=b)",
    "mj_jacSite": "data.jacobian(site=i)",
    "mj_fullM": "data.mass_matrix()",
    "mj_inverse": "data.inverse(qacc)",
    "mj_contactForce": "data.contacts.force",
    "mj_getState": "data.save()",
    "mj_setState": "data.restore(arrays)",
    "mj_ray": "<rangefinder> in data.sensordata, or the program's gsp scan",
}
PACKAGE["mj_kinematics"] = PACKAGE["mj_forward"]


def hint(owner: str, name: str) -> str:
    """What to take for a name that gsp.Model, gsp.Data or gsp ("Model", "Data", "") has not, or ""."""
    if owner == "":
        return PACKAGE.get(name, "")
    said = (MODEL if owner == "Model" else DATA).get(name, "")
    if not said and name in _KINDS:
        kind = _KINDS[name]
        said = f"i = model.id('{kind}', name) is its number"
        if owner == "Data" and kind in _WHERE:
            said = f"{_WHERE[kind]} with i = model.id('{kind}', name)"
    other = "Data" if owner == "Model" else "Model"
    if not said and hasattr(getattr(_gsp, other), name):
        said = f"it is of the {other.lower()}: {other.lower()}.{name}"
    if not said and name in _gsp.world_fields():
        said = f"gsp.Data(model, per_world=['{name}']), then data.values('{name}')"
    return said


def not_assigned(owner: str, name: str) -> str:
    """The sentence of the AttributeError where one is assigned that is for reading."""
    said = {
        "timestep": "gsp.Data(model, timestep=seconds) has another",
        "time": "it is data.steps times the timestep: data.steps[:] = n",
        "steps": "it is a place to write into: data.steps[:] = n",
        "status": "gsp.reset(model, data, mask) begins anew what stopped",
        "worlds": "say it when you make gsp.Data",
        "threads": "say it when you make gsp.Data",
        "model": "say it when you make gsp.Data",
    }.get(name, "")
    if not said and callable(getattr(getattr(_gsp, owner), name)):
        said = "it is a function"
    elif not said and owner == "Model" and name in _gsp.world_fields():
        said = f"gsp.Data(model, per_world=['{name}']), then data.set('{name}', values)"
    elif not said and owner == "Model":
        said = "say it in the MJCF that from_xml or from_string reads"
    elif not said:
        said = "it follows from what is written: data.qpos, qvel, ctrl and their like"
    return f"gsp.{owner}.{name} is for reading: {said}"


def missing(owner: str, name: str) -> str:
    """The sentence of the AttributeError."""
    sentence = f"{'gsp.' + owner if owner else 'the module gsp'} has no attribute '{name}'"
    said = "" if name.startswith("_") else hint(owner, name)
    if said:
        return f"{sentence}: {said}"
    import gsp

    near = [] if name.startswith("_") else difflib.get_close_matches(name, dir(getattr(gsp, owner)) if owner else gsp.__all__, 1, 0.75)
    return f"{sentence}: is it {near[0]}?" if near else sentence

