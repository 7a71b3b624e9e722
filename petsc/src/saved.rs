//! States at the ends of load levels, saved in files.

use std::fs;
use std::io::{Error as IoError, ErrorKind, Write};
use std::path::{Path, PathBuf};

use semismooth::contact::{ContactError, NodeLaw};
use thiserror::Error as ThisError;

use crate::DistributedContact;
use crate::world::Error;

/// Errors of saved states.
#[derive(Debug, ThisError)]
#[non_exhaustive]
pub enum SavedError {
    /// A file that cannot be read or written.
    #[error("{path}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: IoError,
    },
    /// A file that is not a saved state, or is incomplete.
    #[error("{path} is not a saved state, or not all of one")]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// A state of another number of processes.
    #[error("{path} was saved by {saved} processes, and this job has {now}")]
    Processes {
        /// The file.
        path: PathBuf,
        /// The number when the state was saved.
        saved: usize,
        /// The number of processes of this job.
        now: usize,
    },
    /// A state of a body with other sizes or another mean stiffness at the contact nodes, or of a law with another number of history
    /// variables. Other changes of body or law are not noticed.
    #[error("{path} was saved for another body, or a law with other history variables")]
    OtherProblem {
        /// The file.
        path: PathBuf,
    },
    /// The state does not fit the problem.
    #[error(transparent)]
    Contact(#[from] ContactError),
}

/// The end of a load level, as [`resume`](DistributedContact::resume) returns it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SavedLevel {
    /// Number of the level.
    pub level: u64,
    /// The parameter there.
    pub alpha: f64,
    /// The displacements, in the form of the argument `start` of [`solve`](DistributedContact::solve).
    pub displacements: Vec<f64>,
}

const MAGIC: u64 = u64::from_le_bytes(*b"smsmpar1");
const COMMITTED: &str = "semismooth state";

impl<L: NodeLaw> DistributedContact<'_, L> {
    /// Saves the end of a load level, after [`end_level`](Self::end_level): one file per process, `NAME.G.R`, and when all of them are
    /// written, `NAME`, which names them; then the previous state is removed. If the job is killed, at any time, the last complete state
    /// remains. Values are not rounded. Collective.
    ///
    /// # Errors
    /// Displacements of the wrong length, files that cannot be written.
    pub fn save(
        &self,
        path: impl AsRef<Path>,
        level: u64,
        alpha: f64,
        displacements: &[f64],
    ) -> Result<(), Error> {
        let (path, world) = (path.as_ref(), self.world());
        world.agree(self.check(alpha, displacements, None))?;
        let before = match world.rank() {
            0 => committed(path).or_else(|e| match e {
                // A file that is not a state is overwritten.
                SavedError::Damaged { .. } => Ok(None),
                e => Err(e),
            }),
            _ => Ok(None),
        };
        let before = world.agree(before)?.map_or(0, |c| c.generation);
        let before = world.max([before as f64])?[0] as u64;
        let mut words = self.head().to_vec();
        words.extend([level, alpha.to_bits()]);
        let lists = [displacements, &self.reference, &self.history];
        words.extend(lists.iter().flat_map(|l| l.iter().map(|v| v.to_bits())));
        words.push(digest(&words));
        let own = piece(path, before + 1, world.rank());
        world.agree(replace(
            &own,
            words.iter().flat_map(|w| w.to_le_bytes()).collect(),
        ))?;
        let told = format!("{COMMITTED} {} of {} processes\n", before + 1, world.size());
        world.agree(match world.rank() {
            0 => replace(path, told.into_bytes()),
            _ => Ok(()),
        })?;
        // A failure to remove the old state does no harm.
        let _ = fs::remove_file(piece(path, before, world.rank()));
        Ok(())
    }

    /// Restores the state that [`save`](Self::save) wrote to this path, on the same number of processes; `None` if there is none. The next
    /// level gives the same result as in a job that was not interrupted. Collective.
    ///
    /// ```no_run
    /// use semismooth::contact::NodeLaw;
    /// use semismooth_petsc::{DistributedContact, Error};
    /// fn history(problem: &mut DistributedContact<'_, impl NodeLaw>, load: &[f64]) -> Result<(), Error> {
    ///     let saved = problem.resume("history.state")?;
    ///     let (first, mut u) = saved.map_or((1, None), |s| (s.level + 1, Some(s.displacements)));
    ///     for level in first..=20 {
    ///         let alpha = level as f64 / 20.0;
    ///         let now: Vec<f64> = load.iter().map(|f| alpha * f).collect();
    ///         let found = problem.solve(alpha, &now, u.as_deref())?;
    ///         problem.end_level(alpha, &found)?;
    ///         problem.save("history.state", level, alpha, &found.displacements)?;
    ///         u = Some(found.displacements);
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// Files that cannot be read or are damaged, states of another body or of another number of processes.
    pub fn resume(&mut self, path: impl AsRef<Path>) -> Result<Option<SavedLevel>, Error> {
        let (path, world) = (path.as_ref(), self.world());
        let committed = match world.rank() {
            0 => committed(path).and_then(|c| match c {
                Some(c) if c.processes != world.size() => Err(SavedError::Processes {
                    path: path.into(),
                    saved: c.processes,
                    now: world.size(),
                }),
                c => Ok(c),
            }),
            _ => Ok(None),
        };
        let generation = world.agree(committed)?.map_or(0, |c| c.generation);
        let generation = world.max([generation as f64])?[0] as u64;
        if generation == 0 {
            return Ok(None);
        }
        let read = self.read(&piece(path, generation, world.rank()));
        let [displacements, reference, history, told] = world.agree(read)?;
        (self.reference, self.history) = (reference, history);
        Ok(Some(SavedLevel {
            level: told[0].to_bits(),
            alpha: told[1],
            displacements,
        }))
    }

    /// The numbers that a state must share with the problem: sizes, the process, the mean stiffness of contact nodes.
    fn head(&self) -> [u64; 9] {
        let (world, body) = (self.world(), self.body());
        let counts = [
            world.rank(),
            world.size(),
            body.num_displacements(),
            body.num_contacts(),
            body.num_free(),
            self.reference.len(),
            self.history.len(),
        ]
        .map(|n| n as u64);
        let mut head = [0; 9];
        head[0] = MAGIC;
        head[1..8].copy_from_slice(&counts);
        head[8] = body.node_stiffness.to_bits();
        head
    }

    /// Displacements, reference positions, history; level and parameter, all as bits.
    fn read(&self, path: &Path) -> Result<[Vec<f64>; 4], SavedError> {
        let bytes = fs::read(path).map_err(|source| SavedError::Io {
            path: path.into(),
            source,
        })?;
        let damaged = || SavedError::Damaged { path: path.into() };
        let (words, rest) = bytes.as_chunks();
        let words: Vec<u64> = words.iter().map(|w| u64::from_le_bytes(*w)).collect();
        let (last, words) = words.split_last().ok_or_else(damaged)?;
        if !rest.is_empty() || *last != digest(words) || words.len() < 11 || words[0] != MAGIC {
            return Err(damaged());
        }
        let (head, mut values) = words.split_at(9);
        if head != self.head() {
            return Err(SavedError::OtherProblem { path: path.into() });
        }
        let lengths = [
            2,
            self.body().num_free(),
            self.reference.len(),
            self.history.len(),
        ];
        if values.len() != lengths.iter().sum::<usize>() {
            return Err(damaged());
        }
        let [told, u, reference, history] = lengths.map(|n| {
            let (list, rest) = values.split_at(n);
            values = rest;
            list.iter().map(|v| f64::from_bits(*v)).collect::<Vec<f64>>()
        });
        self.check(told[1], &u, None)?;
        Ok([u, reference, history, told])
    }
}

struct Committed {
    generation: u64,
    processes: usize,
}

/// The state that a file names, if there is one.
fn committed(path: &Path) -> Result<Option<Committed>, SavedError> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) if e.kind() == ErrorKind::InvalidData => String::new(),
        Err(source) => {
            return Err(SavedError::Io {
                path: path.into(),
                source,
            });
        }
    };
    let numbers = text.strip_prefix(COMMITTED).map(str::split_whitespace);
    let words: Vec<&str> = numbers.into_iter().flatten().collect();
    match words[..] {
        [generation, "of", processes, "processes"] => {
            let numbers = (generation.parse(), processes.parse());
            if let (Ok(generation), Ok(processes)) = numbers
                && generation > 0
            {
                return Ok(Some(Committed {
                    generation,
                    processes,
                }));
            }
            Err(SavedError::Damaged { path: path.into() })
        }
        _ => Err(SavedError::Damaged { path: path.into() }),
    }
}

fn piece(path: &Path, generation: u64, rank: usize) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(format!(".{generation}.{rank}"));
    name.into()
}

/// Writes a file atomically: it is complete or does not exist.
fn replace(path: &Path, bytes: Vec<u8>) -> Result<(), SavedError> {
    let mut part = path.as_os_str().to_os_string();
    part.push(".part");
    let part = PathBuf::from(part);
    let write = || {
        let mut file = fs::File::create(&part)?;
        file.write_all(&bytes)?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().map_err(|source| SavedError::Io {
        path: path.into(),
        source,
    })
}

/// FNV-1a, word by word.
fn digest(words: &[u64]) -> u64 {
    let step = |h: u64, w: &u64| (h ^ w).wrapping_mul(0x0000_0100_0000_01b3);
    words.iter().fold(0xcbf2_9ce4_8422_2325, step)
}
