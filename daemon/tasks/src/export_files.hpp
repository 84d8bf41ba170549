#pragma once
/// Writes the files of an export. The files get their names only after they were read back and
/// proven.

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "abbe/exports/prove_export.hpp"

namespace abbe::daemon {

/// Io unless the files can be written to `out`, which is a file in an existing folder, or a folder
/// that may be missing. A device or pipe is never replaced.
[[nodiscard]] Result<void> require_place(const FormatFacts&, const std::filesystem::path& out);

/// The paths of the files: `out` itself, or the files in the folder `out`.
[[nodiscard]] std::vector<std::filesystem::path> final_paths(const FormatFacts&,
                                                             const std::filesystem::path& out,
                                                             std::span<const ExportFile>);

using ProofOfFiles = std::function<Result<ExportProof>(std::span<const ExportFile>)>;

/// Writes the files under temporary names beside `paths`, reads them, and renames them if `prove`
/// accepts the texts that were read. Removes the temporary files otherwise; earlier files at
/// `paths` are then unchanged. Creates the folder of the files.
[[nodiscard]] Result<ExportProof> write_when_proven(std::span<const ExportFile>,
                                                    std::span<const std::filesystem::path> paths,
                                                    const ProofOfFiles& prove);

}  // namespace abbe::daemon
