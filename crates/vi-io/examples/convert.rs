//! Converts any file that vi-io reads into a VTU file:
//! `cargo run -p vi-io --example convert -- IN OUT.vtu [base64] [single] [uncompressed]`

use std::path::Path;
use std::process::ExitCode;

use vi_io::{
    DataArray, IoError, Precision, VtuArray, VtuEncoding, VtuFrame, VtuOptions, VtuValues, read_mesh,
    write_vtu,
};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, words @ ..] = &arguments[..] else {
        eprintln!("usage: convert IN OUT.vtu [base64] [single] [uncompressed]");
        return ExitCode::from(2);
    };
    let mut options = VtuOptions::default();
    for word in words {
        match word.as_str() {
            "base64" => options.encoding = VtuEncoding::InlineBase64,
            "single" => options.precision = Precision::Single,
            "uncompressed" => options.compression = 0,
            _ => {
                eprintln!("unknown option \"{word}\": base64, single and uncompressed are possible");
                return ExitCode::from(2);
            }
        }
    }
    match convert(Path::new(input), Path::new(output), options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

fn convert(input: &Path, output: &Path, options: VtuOptions) -> Result<(), IoError> {
    let file = read_mesh(input)?;
    for note in &file.notes {
        eprintln!("{}: {note}", input.display());
    }
    let (point_data, cell_data) = (arrays(&file.point_data), arrays(&file.cell_data));
    let frame = VtuFrame {
        points: &file.mesh.points,
        blocks: &file.mesh.blocks,
        far: &[],
        regions: &file.mesh.regions,
        point_data: &point_data,
        cell_data: &cell_data,
        time: file.time,
        field_data: &[],
    };
    write_vtu(output, &frame, options)
}

fn arrays(data: &[DataArray]) -> Vec<VtuArray<'_>> {
    data.iter()
        .map(|DataArray { name, components, values }| VtuArray {
            name,
            components: *components,
            values: VtuValues::Real(values),
        })
        .collect()
}
