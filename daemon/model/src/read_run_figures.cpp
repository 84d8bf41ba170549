#include "read_run_figures.hpp"

#include <string>
#include <vector>

namespace abbe::daemon {
namespace {

constexpr const char* kResiduals = "path_mm_before_um_after_um";

std::vector<std::string> read_notes(ModelReader& in, const ModelJson* list) {
  std::vector<std::string> notes;
  if (list == nullptr) return notes;
  if (!list->is_array()) in.fault("run.notes", "must be an array");
  for (const ModelJson& note : *list) {
    if (note.is_string())
      notes.push_back(note.get<std::string>());
    else
      in.fault("run.notes", "must be an array of strings");
  }
  return notes;
}

std::vector<RunFigures::Interval> read_intervals(ModelReader& in, const ModelJson* list) {
  const std::string path = std::string("run.") + kResiduals;
  std::vector<RunFigures::Interval> intervals;
  if (list == nullptr) return intervals;
  if (!list->is_array()) in.fault(path, "must be an array");
  for (const ModelJson& entry : *list) {
    if (!entry.is_array() || entry.size() != 3) {
      in.fault(path, "every element must be three numbers");
      continue;
    }
    intervals.push_back({in.number(entry[0], path, kMm), in.number(entry[1], path, kMicroUnit),
                         in.number(entry[2], path, kMicroUnit)});
  }
  return intervals;
}

/// Models of earlier versions do not have them.
std::vector<std::vector<calib::Vector3>> read_places(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.places_mm";
  std::vector<std::vector<calib::Vector3>> places;
  if (!run.is_object() || !run.contains("places_mm")) return places;
  const ModelJson& list = run.at("places_mm");
  if (!list.is_array()) {
    in.fault(path, "must be an array");
    return places;
  }
  for (const ModelJson& line : list) places.push_back(in.vectors(&line, path));
  return places;
}

}  // namespace

std::optional<RunFigures> read_run_figures(ModelReader& in) {
  const std::string path = "run";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& run = in.root().at(path);
  return RunFigures{.held_out = in.text_of(run, path, "held_out"),
                    .held_out_before_m = in.number_of(run, path, "held_out_before_um", kMicroUnit),
                    .held_out_after_m = in.number_of(run, path, "held_out_after_um", kMicroUnit),
                    .notes = read_notes(in, in.find(run, path, "notes")),
                    .residuals = read_intervals(in, in.find(run, path, kResiduals)),
                    .places_m = read_places(in, run)};
}

}  // namespace abbe::daemon
