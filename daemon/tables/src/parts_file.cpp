#include "abbe/tables/parts_file.hpp"

#include <fmt/format.h>

#include <map>
#include <set>

#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {
namespace {

void read_file_name(Section& part, std::string_view key, std::string& out,
                    const std::filesystem::path& folder, Need need = Need::Optional) {
  if (part.get(key, out, need)) out = (folder / out).string();
}

void read_vector(Section& part, std::string_view key, std::optional<calib::Vector3>& out) {
  calib::Vector3 given;
  if (get_vector(part, key, given, kMilli)) out = given;
}

RunFiles read_run(Section& part, std::size_t number, const std::filesystem::path& folder) {
  RunFiles run{.name = fmt::format("run {}", number)};
  part.get("name", run.name);
  read_file_name(part, "recording", run.recording, folder);
  const Need files = run.recording.empty() ? Need::Required : Need::Optional;
  read_file_name(part, "path", run.path, folder, files);
  read_file_name(part, "tracker", run.tracker, folder, files);
  read_file_name(part, "encoder", run.encoder, folder);
  if (!run.recording.empty() && !(run.path + run.tracker + run.encoder).empty())
    part.fault("recording", "must not be given beside path, tracker or encoder: it contains them");
  read_vector(part, "target_offset_mm", run.target_offset_m);
  read_vector(part, "tracker_position_mm", run.tracker_position_m);
  read_vector(part, "tracker_centre_mm", run.tracker_centre_m);
  if (run.tracker_centre_m && !run.recording.empty())
    part.fault("tracker_centre_mm",
               "must not be given beside recording: its points are in the frame of the tracker");
  part.get("instrument", run.instrument);
  part.get("range_offset", run.range_offset);
  part.close();
  return run;
}

void read_temperature(Section& part, ArrayFiles& out) {
  double artefact_C = 0.0;
  const bool known = part.get("artefact_C", artefact_C, kPlain, {-50.0, 100.0});
  const bool u = part.get("u_artefact_K", out.u_artefact_K, kPlain, {0.0, 50.0},
                          known ? Need::Required : Need::Optional);
  if (known) out.artefact_C = artefact_C;
  if (u && !known) part.fault("u_artefact_K", "needs artefact_C");
}

ArrayFiles read_array(Section& part, std::size_t number, const std::filesystem::path& folder) {
  ArrayFiles array{.name = fmt::format("array {}", number)};
  part.get("name", array.name);
  read_file_name(part, "touches", array.touches, folder);
  read_file_name(part, "calibrator", array.calibrator, folder);
  read_file_name(part, "errors", array.errors, folder);
  if (array.touches.empty() == array.errors.empty())
    part.fault("touches", "needs either touches and calibrator, or errors");
  else if (array.touches.empty() != array.calibrator.empty())
    part.fault("calibrator", "needs touches, and touches need it");
  read_vector(part, "tip_offset_mm", array.tip_offset_m);
  if (int positions = 0; part.get_integer("positions", positions, 2, 1000))
    array.positions = positions;
  read_temperature(part, array);
  part.get("s_centre_um", array.s_centre_m, kMicro, kPositive);
  part.close();
  return array;
}

BarFiles read_bar(Section& part, std::size_t number, const std::filesystem::path& folder) {
  BarFiles bar{.name = fmt::format("bar {}", number)};
  part.get("name", bar.name);
  read_file_name(part, "bar", bar.bar, folder, Need::Required);
  read_file_name(part, "plan", bar.plan, folder, Need::Required);
  read_file_name(part, "points", bar.points, folder, Need::Required);
  part.close();
  return bar;
}

void check_names(const PartsFile& parts, Section& root) {
  std::set<std::string> names;
  const auto take = [&](const std::string& key, const std::string& name) {
    if (!names.insert(name).second)
      root.fault(key, fmt::format("two parts have the name \"{}\"", name));
  };
  for (const RunFiles& run : parts.runs) take("run", run.name);
  for (const ArrayFiles& array : parts.arrays) take("array", array.name);
  for (const BarFiles& bar : parts.bars) take("bar", bar.name);
}

/// Adds a fault if runs with the same range_offset have different instruments, because two
/// instruments cannot have a common offset.
void check_range_offsets(const PartsFile& parts, Section& root) {
  std::map<std::string, const RunFiles*> first;
  for (const RunFiles& run : parts.runs) {
    if (run.range_offset.empty()) continue;
    const RunFiles& other = *first.try_emplace(run.range_offset, &run).first->second;
    if (other.instrument != run.instrument)
      root.fault(
          "run",
          fmt::format("\"{}\" and \"{}\" have range_offset = \"{}\", but instrument = "
                      "\"{}\" and \"{}\": runs share an offset of the ranges only with "
                      "the same instrument",
                      other.name, run.name, run.range_offset, other.instrument, run.instrument));
  }
}

}  // namespace

Result<PartsFile> read_parts_toml(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);
  Faults faults(file.string());
  Section root(&*table, "", {1, 1}, faults);
  PartsFile out{{file.filename().string(), sha256_hex(*text)}, {}, {}, {}};

  for (Section& part : root.children("run"))
    out.runs.push_back(read_run(part, out.runs.size() + 1, file.parent_path()));
  for (Section& part : root.children("array"))
    out.arrays.push_back(read_array(part, out.arrays.size() + 1, file.parent_path()));
  for (Section& part : root.children("bar"))
    out.bars.push_back(read_bar(part, out.bars.size() + 1, file.parent_path()));
  root.close();
  if (out.runs.empty())
    root.fault("run", "needs at least one: the model has the tables of the first [[run]]");
  else if (out.runs.size() + out.arrays.size() + out.bars.size() < 2)
    root.fault("array", "needs two parts or more, each a [[run]], an [[array]] or a [[bar]]");
  check_names(out, root);
  check_range_offsets(out, root);

  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return out;
}

}  // namespace abbe::daemon
