//! The thread that makes pieces ready for the adapter.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use enfilade::cpg::wire::{PieceContent, read_piece};
use enfilade::runtime::Sight;
use enfilade::stream::PieceId;
use enfilade_render::{GpuPiece, PieceMaker, RenderError};

/// A piece made ready, or the reason why it cannot be.
pub(super) struct ReadyPiece {
    pub(super) piece: PieceId,
    pub(super) arrival: u64,
    pub(super) pieces: Result<Vec<GpuPiece>, String>,
}

/// A thread that makes pieces ready. It ends when this is dropped, after the piece at hand.
pub(super) struct Workshop {
    orders: Sender<(PieceId, u64, Vec<u8>)>,
    pub(super) made: Receiver<ReadyPiece>,
}

impl Workshop {
    pub(super) fn open(maker: PieceMaker, sight: Sight) -> Self {
        let (orders, ordered) = channel::<(PieceId, u64, Vec<u8>)>();
        let (out, made) = channel();
        thread::spawn(move || {
            for (piece, arrival, bytes) in ordered {
                let pieces = make(&maker, &sight, &bytes);
                let made = ReadyPiece {
                    piece,
                    arrival,
                    pieces,
                };
                if out.send(made).is_err() {
                    break;
                }
            }
        });
        Self { orders, made }
    }

    pub(super) fn make(&self, piece: PieceId, arrival: u64, bytes: Vec<u8>) {
        // The thread is there as long as the receiver of what it makes.
        let _ = self.orders.send((piece, arrival, bytes));
    }
}

/// Makes the bytes of a piece ready for the adapter.
fn make(maker: &PieceMaker, sight: &Sight, bytes: &[u8]) -> Result<Vec<GpuPiece>, String> {
    let pieces = match read_piece(bytes).map_err(|why| why.to_string())? {
        PieceContent::Batches(batches) => (batches.iter())
            .map(|(batch, primitive)| maker.batch(sight, *batch, primitive))
            .collect(),
        PieceContent::Mesh { mesh, primitives } => {
            maker.mesh(mesh, &primitives).map(|made| vec![made])
        }
        PieceContent::Image { image, bytes } => maker.image(image, &bytes).map(|made| vec![made]),
    };
    pieces.map_err(|why: RenderError| why.to_string())
}
