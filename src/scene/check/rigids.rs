//! Checks rigid bodies, their joints and attachments.

use super::checker::Checker;
use crate::scene::Scene;
use crate::scene::problem::some_of;

/// Checks rigid bodies, their joints and attachments.
pub(super) fn rigids(check: &mut Checker, scene: &Scene) {
    let names: Vec<_> = scene.rigids.iter().map(|rigid| rigid.name.as_str()).collect();
    let keyed = |key: String, part: &str| if part.is_empty() { key } else { format!("{key}.{part}") };
    for (i, rigid) in scene.rigids.iter().enumerate() {
        for (part, message) in rigid.problems() {
            check.say(keyed(format!("rigid[{i}]"), part), message);
        }
    }
    for (i, joint) in scene.joints.iter().enumerate() {
        for (part, name) in [("body", Some(joint.body())), ("to", joint.to())] {
            if let Some(name) = name
                && !names.contains(&name)
            {
                let message = if scene.bodies.iter().any(|body| body.name == name) {
                    format!(
                        "'{name}' is deformable, and joints join rigid bodies: hold a part of it by [[attach]] with `to`, the \
                         name of a [[rigid]], and join that"
                    )
                } else if names.is_empty() {
                    format!("there is no rigid body '{name}': the scene has no table [[rigid]]")
                } else {
                    format!("there is no rigid body '{name}'; there are: {}", some_of(&names))
                };
                check.say(format!("joint[{i}].{part}"), message);
            }
        }
        for (part, message) in joint.problems() {
            check.say(keyed(format!("joint[{i}]"), part), message);
        }
        let is_held = |name: Option<&str>| match name {
            Some(name) => scene.rigids.iter().any(|rigid| rigid.name == name && rigid.is_prescribed()),
            None => true,
        };
        if is_held(Some(joint.body())) && is_held(joint.to()) {
            check.say(
                format!("joint[{i}]"),
                "joins two bodies whose motion is prescribed: remove this joint, or free one of them",
            );
        }
    }
    for (i, attach) in scene.attachments.iter().enumerate() {
        let Some(to) = attach.to.as_deref().filter(|to| names.contains(to)) else { continue };
        for (part, is_given) in [
            ("stiffness", attach.stiffness.is_some()),
            ("length", attach.length.is_some()),
            ("surface", attach.surface.is_some()),
        ] {
            if is_given {
                let message =
                    format!("'{to}' is rigid and holds nodes exactly where they are: remove this key");
                check.say(format!("attach[{i}].{part}"), message);
            }
        }
    }
}
