//! Random scripts: after every edit the scene is its document's, and all of them can be undone and done again.

use std::sync::Arc;

use proptest::prelude::*;

use crate::fixtures::{Step, chair, edit, steps, write_chair};
use crate::oracle::{check, differences};
use crate::{editor, open};
use rebake::scene::edit::Editor;

fn run(mut editor: Editor, steps: &[Step]) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    write_chair(folder.path());
    let state = |editor: &Editor| (editor.document().json.to_string(), editor.scene().clone());
    let mut states = vec![state(&editor)];
    for step in steps {
        let old = editor.scene().clone();
        let change = match edit(&editor, step) {
            None if states.len() == 1 => {
                prop_assert!(editor.undo().is_err());
                continue;
            }
            None => {
                states.pop();
                editor.undo().unwrap()
            }
            Some(edit) => match editor.apply(&edit, folder.path()) {
                Ok(change) => {
                    states.push(state(&editor));
                    change
                }
                Err(error) => {
                    let (json, _) = state(&editor);
                    prop_assert_eq!(&json, &states[states.len() - 1].0, "{}", error);
                    prop_assert!(Arc::ptr_eq(&old, editor.scene()));
                    prop_assert!(!error.to_string().contains('\n'), "{}", error);
                    continue;
                }
            },
        };
        prop_assert_eq!(&change, &differences(&old, editor.scene()));
        let boxes = change.boxes(&old, editor.scene());
        prop_assert!(boxes.len() <= 2 * change.objects.len());
        check(&editor)?;
    }
    let last = state(&editor);
    let count = states.len() - 1;
    for (json, scene) in states.iter().rev().skip(1) {
        editor.undo().unwrap();
        prop_assert_eq!(&state(&editor), &(json.clone(), scene.clone()));
    }
    prop_assert!(editor.undo().is_err());
    for _ in 0..count {
        editor.redo().unwrap();
    }
    prop_assert_eq!(&state(&editor), &last);
    Ok(())
}

fn cases(cases: u32) -> ProptestConfig {
    // The message of a failure holds the script; a file beside this one would be found by nobody.
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases(24))]
    #[test]
    fn scripts_over_cornell(steps in steps(1..30)) {
        run(open("cornell"), &steps)?;
    }

    #[test]
    fn scripts_over_a_tree_with_matrices_and_shared_lights(steps in steps(1..20)) {
        run(editor(&chair()), &steps)?;
    }
}

proptest! {
    #![proptest_config(cases(2))]
    #[test]
    fn scripts_over_the_museum(steps in steps(3..6)) {
        run(open("museum"), &steps)?;
    }
}
