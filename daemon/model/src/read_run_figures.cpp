#include "read_run_figures.hpp"

#include <string>
#include <vector>

#include "abbe/base/utc_text.hpp"

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

/// Reads the places; models of earlier versions do not have them.
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

/// The elements of an array that models of earlier versions do not have.
std::vector<const ModelJson*> elements(ModelReader& in, const ModelJson& run,
                                       const std::string& key) {
  std::vector<const ModelJson*> all;
  if (!run.is_object() || !run.contains(key)) return all;
  if (!run.at(key).is_array()) in.fault("run." + key, "must be an array");
  if (run.at(key).is_array())
    for (const ModelJson& element : run.at(key)) all.push_back(&element);
  return all;
}

std::vector<RunFigures::Part> read_parts(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.parts";
  std::vector<RunFigures::Part> parts;
  for (const ModelJson* entry : elements(in, run, "parts")) {
    RunFigures::Part part{.name = in.text_of(*entry, path, "name"),
                          .count = in.count_of(*entry, path, "count"),
                          .before_rms_m = in.number_of(*entry, path, "before_rms_um", kMicroUnit),
                          .after_rms_m = in.number_of(*entry, path, "after_rms_um", kMicroUnit),
                          .after_max_m = in.number_of(*entry, path, "after_max_um", kMicroUnit)};
    if (entry->is_object() && entry->contains("from_s"))
      part.time_s = {in.number_of(*entry, path, "from_s", 0),
                     in.number_of(*entry, path, "to_s", 0)};
    parts.push_back(std::move(part));
  }
  return parts;
}

std::optional<RunFigures::Series> read_series(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.series", points = "at_after_um";
  if (!run.is_object() || !run.contains("series")) return std::nullopt;
  const ModelJson& entry = run.at("series");
  RunFigures::Series series{.count = in.count_of(entry, path, "count"), .points = {}};
  const std::string over = in.text_of(entry, path, "over");
  series.over_time = over == kOverTime;
  if (!series.over_time && over != kOverNumber)
    in.fault(path + ".over", fmt::format("must be \"{}\" or \"{}\"", kOverTime, kOverNumber));
  if (in.find(entry, path, points) == nullptr) return series;
  for (const ModelJson* point : elements(in, entry, points)) {
    if (point->is_array() && point->size() == 2)
      series.points.push_back(
          {in.number((*point)[0], path, 0), in.number((*point)[1], path, kMicroUnit)});
    else
      in.fault(path + "." + points, "every element must be two numbers");
  }
  return series;
}

std::size_t count_at(ModelReader& in, const ModelJson& value, const std::string& path) {
  if (value.is_number_unsigned()) return value.get<std::size_t>();
  in.fault(path, "must be a whole number");
  return 0;
}

std::vector<std::size_t> read_sigma_counts(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.sigma_counts";
  std::vector<std::size_t> counts;
  for (const ModelJson* count : elements(in, run, "sigma_counts"))
    counts.push_back(count_at(in, *count, path));
  if (!counts.empty() && counts.size() != RunFigures::kSigmaIntervals)
    in.fault(path,
             fmt::format("{} counts, expected {}", counts.size(), RunFigures::kSigmaIntervals));
  return counts;
}

std::vector<RunFigures::HeldOutCell> read_cells(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.held_out_cells";
  std::vector<RunFigures::HeldOutCell> cells;
  for (const ModelJson* c : elements(in, run, "held_out_cells")) {
    if (!c->is_array() || c->size() != 6) {
      in.fault(path, "every element must be six numbers");
      continue;
    }
    cells.push_back({.slab = count_at(in, (*c)[0], path),
                     .cell = count_at(in, (*c)[1], path),
                     .count = count_at(in, (*c)[2], path),
                     .before_m = in.number((*c)[3], path, kMicroUnit),
                     .after_m = in.number((*c)[4], path, kMicroUnit),
                     .sigma_m = in.number((*c)[5], path, kMicroUnit)});
  }
  return cells;
}

std::vector<std::string> read_texts(ModelReader& in, const ModelJson& list,
                                    const std::string& path) {
  std::vector<std::string> texts;
  if (!list.is_array()) in.fault(path, "must be an array of strings");
  if (list.is_array())
    for (const ModelJson& text : list) {
      if (text.is_string())
        texts.push_back(text.get<std::string>());
      else
        in.fault(path, "must be an array of strings");
    }
  return texts;
}

std::vector<RunFigures::Table> read_tables(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.tables";
  std::vector<RunFigures::Table> tables;
  for (const ModelJson* entry : elements(in, run, "tables")) {
    RunFigures::Table table{.title = in.text_of(*entry, path, "title"),
                            .explanation = in.text_of(*entry, path, "explanation"),
                            .columns = {},
                            .rows = {}};
    if (const ModelJson* columns = in.find(*entry, path, "columns"))
      table.columns = read_texts(in, *columns, path + ".columns");
    if (in.find(*entry, path, "rows") != nullptr)
      for (const ModelJson* row : elements(in, *entry, "rows"))
        table.rows.push_back(read_texts(in, *row, path + ".rows"));
    tables.push_back(std::move(table));
  }
  return tables;
}

/// Reads the dates of the first and last observation.
std::optional<std::array<protocol::UtcTime, 2>> read_measured(ModelReader& in,
                                                              const ModelJson& list) {
  const std::string path = "run.conditions.measured_utc";
  const auto texts = read_texts(in, list, path);
  const auto first = texts.size() == 2 ? utc_from_text(texts[0]) : std::nullopt;
  const auto last = texts.size() == 2 ? utc_from_text(texts[1]) : std::nullopt;
  if (first && last && *first <= *last) return std::array{*first, *last};
  in.fault(path, "must be [first, last], UTC times such as 2024-05-17T08:30:00.000000000Z");
  return std::nullopt;
}

std::optional<RunFigures::Conditions> read_conditions(ModelReader& in, const ModelJson& run) {
  const std::string path = "run.conditions";
  if (!run.is_object() || !run.contains("conditions")) return std::nullopt;
  const ModelJson& entry = run.at("conditions");
  RunFigures::Conditions conditions;
  if (!entry.is_object()) {
    in.fault(path, "must be an object");
    return conditions;
  }
  const auto range = [&](const std::string& key) -> std::optional<std::array<double, 2>> {
    if (!entry.contains(key)) return std::nullopt;
    const auto values = in.numbers(entry.at(key), path + "." + key, 0);
    if (values.size() == 2) return std::array{values[0], values[1]};
    in.fault(path + "." + key, "must be [lowest, highest]");
    return std::nullopt;
  };
  conditions.temperature_K = range("temperature_K");
  conditions.bar_temperature_K = range("bar_temperature_K");
  if (entry.contains("duration_s"))
    conditions.duration_s = in.number_of(entry, path, "duration_s", 0);
  if (entry.contains("feed_mm_per_s"))
    conditions.feed_m_per_s = in.number_of(entry, path, "feed_mm_per_s", kMm);
  if (entry.contains("measured_utc"))
    conditions.measured = read_measured(in, entry.at("measured_utc"));
  return conditions;
}

}  // namespace

std::optional<RunFigures> read_run_figures(ModelReader& in) {
  const std::string path = "run";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& run = in.root().at(path);
  const auto optional_text = [&](const char* key) {
    return run.is_object() && run.contains(key) ? in.text_of(run, path, key) : std::string{};
  };
  return RunFigures{.held_out = in.text_of(run, path, "held_out"),
                    .held_out_before_m = in.number_of(run, path, "held_out_before_um", kMicroUnit),
                    .held_out_after_m = in.number_of(run, path, "held_out_after_um", kMicroUnit),
                    .notes = read_notes(in, in.find(run, path, "notes")),
                    .residuals = read_intervals(in, in.find(run, path, kResiduals)),
                    .places_m = read_places(in, run),
                    .part_kind = optional_text("part_kind"),
                    .parts = read_parts(in, run),
                    .series = read_series(in, run),
                    .sigma_counts = read_sigma_counts(in, run),
                    .held_out_cells = read_cells(in, run),
                    .tables = read_tables(in, run),
                    .conditions = read_conditions(in, run),
                    .of_model = optional_text("of_model")};
}

}  // namespace abbe::daemon
