//! `--set key.path=value`: sets keys of a scene file before it is read.
//!
//! A path is written as messages print it, `body[0].material.young`; `body.0.material.young` is the same.

use toml_edit::{DocumentMut, InlineTable, Item, Value};

use super::Problem;

/// Returns the text with all possible assignments made, and the problems of the others. A text that is not TOML is
/// returned unchanged.
pub(super) fn set(text: &str, assignments: &[String]) -> (String, Vec<Problem>) {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return (text.to_owned(), Vec::new()) };
    let mut problems = Vec::new();
    for assignment in assignments {
        let result = match assignment.split_once('=') {
            Some((path, value)) => assign(document.as_item_mut(), path.trim(), value.trim()),
            None => Err("write it as key.path=value".to_owned()),
        };
        if let Err(why) = result {
            problems.push(Problem::new("", format!("--set {assignment}: {why}")));
        }
    }
    if assignments.is_empty() { (text.to_owned(), problems) } else { (document.to_string(), problems) }
}

/// A step of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

fn assign(root: &mut Item, path: &str, value: &str) -> Result<(), String> {
    let steps =
        steps(path).ok_or_else(|| format!("`{path}` is not a key; write it as body[0].material.young"))?;
    let mut item = root;
    for (depth, step) in steps.iter().enumerate() {
        let here = words(&steps[..depth]);
        item = match *step {
            Step::Index(index) => match length(item) {
                Some(count) if index < count => &mut item[index],
                Some(1) => return Err(format!("there is only `{here}[0]`")),
                Some(count) => return Err(format!("there are {count} of `{here}`, from `{here}[0]` on")),
                None if item.is_none() => {
                    return Err(format!("there is no `{here}` in the scene; set it as a whole, `{here}=…`"));
                }
                None => return Err(format!("`{here}` is not a list")),
            },
            Step::Key(name) => {
                if length(item).is_some() {
                    let rest = words(&steps[depth..]);
                    return Err(format!(
                        "`{here}` is a list; write `{here}[0].{rest}` for its first element"
                    ));
                }
                let Some(table) = item.as_table_like() else {
                    return Err(format!("`{here}` is a value and has no keys"));
                };
                let is_key = matches!(steps.get(depth + 1), Some(Step::Key(_)));
                if is_key && !table.contains_key(name) {
                    item[name] = match item {
                        Item::Table(_) => toml_edit::table(),
                        _ => Item::Value(InlineTable::new().into()),
                    };
                }
                &mut item[name]
            }
        };
    }
    // A value that is not TOML is taken as a string: `--set time.scheme=gauss` needs no quotes.
    let value: Value = value.parse().unwrap_or_else(|_| value.into());
    *item = match (&*item, value) {
        (Item::Table(_), Value::InlineTable(table)) => Item::Table(table.into_table()),
        (Item::Table(_), _) => return Err(format!("`{}` is a table; set one of its keys", words(&steps))),
        (_, value) => Item::Value(value),
    };
    Ok(())
}

/// Parses the steps of a path, or returns `None` if it is not a path.
fn steps(path: &str) -> Option<Vec<Step<'_>>> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (name, mut indices) = part.split_at(part.find('[').unwrap_or(part.len()));
        match name.parse() {
            Ok(index) => steps.push(Step::Index(index)),
            Err(_) if !name.is_empty() => steps.push(Step::Key(name)),
            Err(_) => return None,
        }
        while !indices.is_empty() {
            let (index, rest) = indices.strip_prefix('[')?.split_once(']')?;
            steps.push(Step::Index(index.parse().ok()?));
            indices = rest;
        }
    }
    Some(steps)
}

/// Formats steps as messages print them.
fn words(steps: &[Step]) -> String {
    let mut text = String::new();
    for step in steps {
        match step {
            Step::Index(index) => text += &format!("[{index}]"),
            Step::Key(name) if text.is_empty() => text += name,
            Step::Key(name) => text += &format!(".{name}"),
        }
    }
    text
}

/// Returns the number of elements of a list.
fn length(item: &Item) -> Option<usize> {
    match item {
        Item::ArrayOfTables(tables) => Some(tables.len()),
        Item::Value(Value::Array(values)) => Some(values.len()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "gravity = [0, 0, -9.81]\n[time]\nend = 1\n[[body]]\nname = \"a\"\n\
                         box = { size = [1, 1, 1] }\n[[body]]\nname = \"b\"\n";

    fn after(assignment: &str) -> DocumentMut {
        let (text, problems) = set(SCENE, &[assignment.to_owned()]);
        assert!(problems.is_empty(), "{problems:?}");
        text.parse().unwrap()
    }

    #[test]
    fn brackets_and_dots_are_the_same_path() {
        for path in ["body[1].name", "body.1.name"] {
            assert_eq!(after(&format!("{path}=new"))["body"][1]["name"].as_str(), Some("new"), "{path}");
        }
        for path in ["body[0].box.size[2]", "body.0.box.size.2"] {
            assert_eq!(
                after(&format!("{path}=3"))["body"][0]["box"]["size"][2].as_integer(),
                Some(3),
                "{path}"
            );
        }
        assert_eq!(after("gravity[2] = -1.5")["gravity"][2].as_float(), Some(-1.5));
        assert_eq!(after("body[0].box.cells=[1,1,1]")["body"][0]["box"]["cells"][0].as_integer(), Some(1));
    }

    #[test]
    fn tables_that_are_missing_are_made() {
        assert_eq!(after("output.history=3")["output"]["history"].as_integer(), Some(3));
        assert_eq!(after("body[1].box.size=[1,2,3]")["body"][1]["box"]["size"][1].as_integer(), Some(2));
        assert_eq!(after("body[0].box.a.b=1")["body"][0]["box"]["a"]["b"].as_integer(), Some(1));
        assert_eq!(after("body[1]={name='c'}")["body"][1]["name"].as_str(), Some("c"));
    }

    /// Every path of keys, indices and other words is either set or refused with a reason, on every kind of value.
    #[test]
    fn no_path_panics() {
        let words = [
            "body", "box", "size", "time", "end", "gravity", "0", "7", "[0]", "[9]", "[", "]", "", "[x]",
            "[-1]",
        ];
        let mut paths = vec![String::new()];
        for _ in 0..3 {
            let longer =
                |path: &String| words.map(|word| format!("{path}.{word}").trim_start_matches('.').to_owned());
            paths = paths.iter().flat_map(longer).collect();
            paths.sort();
            paths.dedup();
            for path in &paths {
                for value in ["1", "[1,1,1]", "{a=1}", "x"] {
                    let assignment = format!("{path}={value}");
                    let (text, problems) = set(SCENE, std::slice::from_ref(&assignment));
                    assert!(text.parse::<DocumentMut>().is_ok(), "{assignment}: {text}");
                    assert!(problems.len() <= 1, "{assignment}: {problems:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_the_way_out() {
        for (assignment, way_out) in [
            ("body.box.cells=[1,1,1]", "body[0].box.cells"),
            ("body[2].name=c", "there are 2 of `body`"),
            ("time.end.x=1", "`time.end` is a value"),
            ("time[0]=1", "`time` is not a list"),
            ("probe[0].name=x", "there is no `probe`"),
            ("time=3", "`time` is a table"),
            ("time.end", "key.path=value"),
            ("body[0.x=1", "is not a key"),
        ] {
            let (_, problems) = set(SCENE, &[assignment.to_owned()]);
            assert_eq!(problems.len(), 1, "{assignment}");
            let message = &problems[0].message;
            assert!(message.contains(way_out) && message.contains(assignment), "{message}");
        }
    }
}
