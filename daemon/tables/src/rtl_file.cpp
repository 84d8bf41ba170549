#include "abbe/tables/rtl_file.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "abbe/base/sha256.hpp"
#include "abbe/base/units.hpp"
#include "text_lines.hpp"

namespace abbe::daemon {
namespace {

constexpr std::string_view kSectionEnd = "::";
constexpr std::array<std::string_view, 4> kRtlSections{"HEADER", "TARGET DATA", "RUNS",
                                                       "DEVIATIONS"};

/// One row of "Run Target Data:".
struct Deviation {
  std::size_t target = 0;  ///< index of the target
  double value = 0.0;      ///< value as in the file
  std::size_t line = 0;
};

/// An entry such as "Target-count: 11": the texts before and after the colon.
struct RtlEntry {
  std::string_view key, value;
};

std::optional<RtlEntry> entry_of(std::string_view line) {
  const auto colon = line.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  return RtlEntry{without_blanks(line.substr(0, colon)), without_blanks(line.substr(colon + 1))};
}

/// Collects targets and deviations.
class RtlRows {
 public:
  RtlRows(std::string_view text, Faults& faults) : lines_(text), faults_(faults) {}

  void read() {
    while (lines_.next()) {
      const auto line = lines_.line();
      if (line.ends_with(kSectionEnd))
        begin_section(line.substr(0, line.size() - kSectionEnd.size()));
      else if (section_ == "HEADER")
        read_header(line);
      else if (section_ == "TARGET DATA")
        read_targets(line);
      else if (section_ == "RUNS")
        read_run_count(line);
      else if (section_ == "DEVIATIONS")
        read_deviation(line);
    }
    check_sections();
  }

  [[nodiscard]] const std::vector<double>& targets_mm() const { return targets_mm_; }
  [[nodiscard]] const std::map<int, std::vector<Deviation>>& runs() const { return runs_; }

  void check_counts() {
    if (target_count_ && *target_count_ != targets_mm_.size())
      faults_.add(target_count_line_, 1, "Target-count",
                  fmt::format("{}, but {} targets follow", *target_count_, targets_mm_.size()));
    if (run_count_ && *run_count_ != runs_.size())
      faults_.add(run_count_line_, 1, "Run-count",
                  fmt::format("{}, but the deviations are of {} runs: the file may be cut off",
                              *run_count_, runs_.size()));
  }

 private:
  void begin_section(std::string_view name) {
    section_ = without_blanks(name);
    in_values_ = false;
    if (!seen_.try_emplace(section_, lines_.number()).second)
      faults_.add(lines_.number(), 1, section_,
                  fmt::format("the section is also in line {}: one measurement per file",
                              seen_.at(section_)));
  }

  void check_sections() {
    for (const auto name : kRtlSections)
      if (!seen_.contains(std::string(name)))
        faults_.add(lines_.number(), 1, name, "the section is missing: the file may be cut off");
    if (seen_.contains("HEADER") && !type_seen_)
      faults_.add(seen_.at("HEADER"), 1, "File type", "missing: only rtl is read");
  }

  void read_header(std::string_view line) {
    const auto entry = entry_of(line);
    if (!entry || entry->key != "File type") return;
    type_seen_ = true;
    if (in_lower_case(entry->value) != "rtl")
      faults_.add(lines_.number(), lines_.column(entry->value), "File type",
                  fmt::format("\"{}\": only rtl, positioning errors, is read: the unit of other "
                              "types is not known; write measured.csv",
                              protocol::printable_line(entry->value)));
  }

  /// The count in an entry. Adds a fault unless it is a whole number of at least 1.
  std::optional<std::size_t> count_of(const RtlEntry& entry) {
    double count = 0.0;
    std::string fault = number_fault(entry.value, count);
    if (fault.empty() && (count < 1.0 || count != std::floor(count) || count > kMostCount))
      fault = fmt::format("{}: must be a whole number, 1 to {:.0f}", count, kMostCount);
    if (fault.empty()) return static_cast<std::size_t>(count);
    faults_.add(lines_.number(), lines_.column(entry.value), entry.key, fault);
    return std::nullopt;
  }

  void read_targets(std::string_view line) {
    const auto entry = entry_of(line);
    if (entry) in_values_ = entry->key == "Targets";
    if (entry && entry->key == "Target-count") {
      target_count_ = count_of(*entry);
      target_count_line_ = lines_.number();
    }
    if (!in_values_) return;
    for (const auto field : fields_of(entry ? entry->value : line)) read_target(field);
  }

  void read_target(std::string_view field) {
    double target_mm = 0.0;
    if (const auto fault = number_fault(field, target_mm); !fault.empty())
      faults_.add_kind("target", lines_.number(), lines_.column(field), "Targets", fault);
    targets_mm_.push_back(target_mm);
  }

  void read_run_count(std::string_view line) {
    const auto entry = entry_of(line);
    if (!entry || entry->key != "Run-count") return;
    run_count_ = count_of(*entry);
    run_count_line_ = lines_.number();
  }

  void read_deviation(std::string_view line) {
    if (const auto entry = entry_of(line)) {
      in_values_ = entry->key == "Run Target Data";
      return;
    }
    if (!in_values_) return;
    const auto fields = fields_of(line);
    if (fields.size() != 3)
      return faults_.add_kind("values", lines_.number(), 1, "Run Target Data",
                              fmt::format("{} values, expected run, target and deviation: the file "
                                          "may be cut off",
                                          fields.size()));
    const auto run = index_in(fields[0], "run", kMostCount);
    const auto target = index_in(fields[1], "target", static_cast<double>(targets_mm_.size()));
    double value = 0.0;
    const auto fault = number_fault(fields[2], value);
    if (!fault.empty())
      faults_.add_kind("deviation", lines_.number(), lines_.column(fields[2]), "deviation", fault);
    if (run && target && fault.empty())
      runs_[static_cast<int>(*run)].push_back({*target - 1, value, lines_.number()});
  }

  std::optional<std::size_t> index_in(std::string_view field, std::string_view name, double most) {
    double index = 0.0;
    std::string fault = number_fault(field, index);
    if (fault.empty() && !(index >= 1.0 && index <= most && index == std::floor(index)))
      fault = fmt::format("{}: must be a whole number, 1 to {:.0f}", index, most);
    if (fault.empty()) return static_cast<std::size_t>(index);
    faults_.add_kind("index", lines_.number(), lines_.column(field), name, fault);
    return std::nullopt;
  }

  static constexpr double kMostCount = 100000.0;

  TextLines lines_;
  Faults& faults_;
  std::string section_;
  std::map<std::string, std::size_t> seen_;  // line number of each section
  bool in_values_ = false, type_seen_ = false;
  std::optional<std::size_t> target_count_, run_count_;
  std::size_t target_count_line_ = 0, run_count_line_ = 0;
  std::vector<double> targets_mm_;
  std::map<int, std::vector<Deviation>> runs_;
};

void check_targets_of_run(int run, const std::vector<Deviation>& rows, std::size_t targets,
                          Faults& faults) {
  std::map<std::size_t, std::size_t> line_of;
  for (const auto& row : rows) {
    const auto [at, is_new] = line_of.try_emplace(row.target, row.line);
    if (!is_new)
      faults.add_kind(
          "repeated", row.line, 1, "target",
          fmt::format("run {} has target {} also in line {}", run, row.target + 1, at->second));
  }
  if (line_of.size() < targets)
    faults.add_kind("incomplete", rows.back().line, 1, "run",
                    fmt::format("run {} has {} of {} targets: the file may be cut off; if the run "
                                "was not completed, delete its lines and correct Run-count",
                                run, line_of.size(), targets));
}

/// True if the run moves towards larger positions; nullopt after a fault.
std::optional<bool> direction_of(int run, const std::vector<Deviation>& rows,
                                 const std::vector<double>& targets_mm, Faults& faults) {
  std::optional<bool> forward;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const double step_mm = targets_mm[rows[i].target] - targets_mm[rows[i - 1].target];
    if (step_mm != 0.0 && !forward) forward = step_mm > 0.0;
    if (step_mm != 0.0 && (step_mm > 0.0) == *forward) continue;
    faults.add_kind("turns", rows[i].line, 1, "target",
                    fmt::format("run {} turns here, from {:g} to {:g} mm: each run must be in one "
                                "direction, through different targets",
                                run, targets_mm[rows[i - 1].target], targets_mm[rows[i].target]));
    return std::nullopt;
  }
  if (!forward)
    faults.add(rows.front().line, 1, "run",
               fmt::format("run {} has one target: its direction is not known", run));
  return forward;
}

MeasuredFile measured_by(const RtlRows& rows, const RtlOptions& options, Faults& faults) {
  MeasuredFile out;
  calib::direct::MeasuredError error{.name = options.error, .readings = {}};
  error.line_m = options.line_m;
  std::vector<std::size_t> lines;
  std::array<int, 2> runs_towards{};  // number of runs towards smaller and towards larger positions

  for (const auto& [run, deviations] : rows.runs()) {
    check_targets_of_run(run, deviations, rows.targets_mm().size(), faults);
    const auto forward = direction_of(run, deviations, rows.targets_mm(), faults);
    if (!forward) continue;
    const int number = ++runs_towards[*forward ? 1 : 0];
    for (const auto& row : deviations) {
      error.readings.push_back({.position_m = rows.targets_mm()[row.target] / kMmPerM,
                                .value = row.value * options.metres_per_deviation,
                                .run = number,
                                .forward = *forward});
      lines.push_back(row.line);
    }
  }

  const auto [smaller, larger] = runs_towards;
  if (!faults.any() && smaller != larger && smaller != 0 && larger != 0)
    faults.add(1, 1, "Run-count",
               fmt::format("{} runs are towards larger positions, {} towards smaller ones: a "
                           "comparison needs as many of both, or one direction only; delete the "
                           "lines of the others and correct Run-count",
                           larger, smaller));
  out.errors.push_back(std::move(error));
  out.lines.push_back(std::move(lines));
  return out;
}

}  // namespace

bool is_rtl(std::string_view text) {
  TextLines lines(text);
  return lines.next() && lines.line() == "HEADER::";
}

Result<MeasuredFile> parse_rtl(std::string_view text, const std::filesystem::path& file,
                               const RtlOptions& options) {
  Faults faults(file.string());
  if (is_no_text(text, faults)) return tl::make_unexpected(faults.to_error());
  RtlRows rows(text, faults);
  rows.read();
  if (!faults.any()) rows.check_counts();
  if (faults.any()) return tl::make_unexpected(faults.to_error());

  auto out = measured_by(rows, options, faults);
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  out.source = {file.filename().string(), sha256_hex(text)};
  return out;
}

}  // namespace abbe::daemon
