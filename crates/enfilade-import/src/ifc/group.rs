//! Processes that are ended with all that they have started.

use std::process::{Child, Command};

/// A process and its descendants, unless they form groups of their own. All are ended when this is dropped, and also if this
/// process is killed: a helper waits for that. On systems without groups, does nothing.
pub(super) struct Group {
    helper: Option<Child>,
}

/// Makes a command the leader of a group.
pub(super) fn lead(command: &mut Command) -> &mut Command {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    command
}

impl Group {
    /// Takes a process that [leads](lead) its group.
    pub(super) fn of(leader: &Child) -> Self {
        #[cfg(unix)]
        {
            use std::process::Stdio;
            // Its input ends when this process does.
            let script = "cat >/dev/null; kill -s KILL -- \"-$1\"";
            let mut command = Command::new("/bin/sh");
            let helper = lead(&mut command)
                .args(["-c", script, "sh", &leader.id().to_string()])
                .stdin(Stdio::piped())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn();
            // Without a shell, the leader alone is ended.
            Self {
                helper: helper.ok(),
            }
        }
        #[cfg(not(unix))]
        {
            let _ = leader;
            Self { helper: None }
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(helper) = &mut self.helper {
            drop(helper.stdin.take());
            // It ends by itself.
            let _ = helper.wait();
        }
    }
}
