#include "export_files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/output_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

struct PendingFile {
  fs::path temporary, final;
};

/// Writes the files and returns their texts as they are on the disk.
Result<std::vector<ExportFile>> written_and_read(std::span<const ExportFile> files,
                                                 std::span<const PendingFile> pending) {
  std::vector<ExportFile> read;
  for (std::size_t i = 0; i < files.size(); ++i) {
    ABBE_TRY(replace_file(pending[i].temporary, files[i].text));
    auto text = read_regular_file(pending[i].temporary);
    ABBE_TRY(text);
    read.push_back({files[i].name, *std::move(text)});
  }
  return read;
}

Result<void> rename_all(std::span<const PendingFile> pending) {
  for (const auto& file : pending) {
    std::error_code fault;
    fs::rename(file.temporary, file.final, fault);
    if (fault)
      return fail(ErrorCode::Io,
                  fmt::format("rename to {}: {}", file.final.string(), fault.message()));
  }
  return {};
}

Result<ExportProof> proven_and_renamed(std::span<const ExportFile> files,
                                       std::span<const PendingFile> pending,
                                       const ProofOfFiles& prove) {
  const auto read = written_and_read(files, pending);
  ABBE_TRY(read);
  auto proof = prove(*read);
  if (!proof) return proof;
  ABBE_TRY(rename_all(pending));
  return proof;
}

}  // namespace

Result<void> require_place(const FormatFacts& facts, const fs::path& out) {
  std::error_code ignored;
  const auto kind = fs::status(out, ignored).type();
  if (facts.folder && (kind == fs::file_type::not_found || kind == fs::file_type::directory))
    return {};
  if (facts.folder)
    return fail(ErrorCode::Io,
                fmt::format("write to {}: {} needs a folder", out.string(), facts.name));

  return require_place_of(out);
}

std::vector<fs::path> final_paths(const FormatFacts& facts, const fs::path& out,
                                  std::span<const ExportFile> files) {
  std::vector<fs::path> paths;
  for (const auto& file : files) paths.push_back(facts.folder ? out / file.name : out);
  return paths;
}

Result<ExportProof> write_when_proven(std::span<const ExportFile> files,
                                      std::span<const fs::path> paths, const ProofOfFiles& prove) {
  std::vector<PendingFile> pending;
  for (const auto& path : paths) {
    pending.push_back({path.string() + fmt::format(".{}.new", ::getpid()), path});
    if (!path.has_parent_path()) continue;
    ABBE_TRY(create_folder(path.parent_path(), NewFolder::OfTheCaller));
  }

  auto proof = proven_and_renamed(files, pending, prove);
  if (!proof) {
    std::error_code ignored;
    for (const auto& file : pending) fs::remove(file.temporary, ignored);
  }
  return proof;
}

}  // namespace abbe::daemon
