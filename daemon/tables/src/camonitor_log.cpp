#include "abbe/tables/camonitor_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "abbe/base/sha256.hpp"
#include "text_lines.hpp"
#include "time_stamp.hpp"

namespace abbe::daemon {
namespace {

constexpr std::string_view kAxisNames = "XYZ";
// longest interval between neighbouring updates of a moving axis, in median intervals
constexpr double kLongestMedians = 1.5;
constexpr std::string_view kLogAgain = "log with camonitor -f 6, without -t and -F";

struct Update {
  double time_s = 0.0, value = 0.0;
  std::size_t line = 0;
};

/// The time in two neighbouring fields of a line, "2022-12-02" and "09:35:54.535389".
std::optional<double> stamp_in(std::string_view date, std::string_view time) {
  const auto length = static_cast<std::size_t>(time.data() + time.size() - date.data());
  return seconds_of_stamp({date.data(), length});
}

std::size_t significant_digits(std::string_view number) {
  std::size_t digits = 0;
  for (const char c : number.substr(0, number.find_first_of("eE"))) {
    const bool is_digit = c >= '0' && c <= '9';
    if (is_digit && (c != '0' || digits > 0)) ++digits;
  }
  return digits;
}

/// The updates of one axis.
class AxisUpdates {
 public:
  AxisUpdates(char axis, std::string pv) : axis_(axis), pv_(std::move(pv)) {}

  [[nodiscard]] const std::string& pv() const { return pv_; }
  [[nodiscard]] const std::vector<Update>& all() const { return updates_; }

  /// Reads a line of this PV.
  void read(const TextLines& lines, const std::vector<std::string_view>& fields, Faults& faults) {
    const auto fault = [&](std::string_view kind, std::string_view at, const std::string& what) {
      faults.add_kind(kind, lines.number(), lines.column(at), pv_, what);
    };
    if (const auto stars = std::ranges::find(fields, "***"); stars != fields.end())
      return fault("lost", *stars,
                   "not connected here: the readings have a gap; delete this line and all lines on "
                   "the other side of the run");
    const auto time_s = fields.size() >= 4 ? stamp_in(fields[1], fields[2]) : std::nullopt;
    if (!time_s)
      return fault("format", fields[0],
                   fmt::format("must be the name, a date, a time of the server and a value, such "
                               "as 2022-12-02 09:35:54.535389 8.84368: {}",
                               kLogAgain));
    if (fields.size() != 4 && fields.size() != 6)
      return fault("value count", fields[3],
                   "must be one value, and status and severity of an alarm if there is one: an "
                   "array, or text, is no scale reading");
    if (fields.size() == 6 && fields[5] == "INVALID")
      return fault("invalid", fields[3], "the value is INVALID: delete the line");

    double value = 0.0;
    if (const auto what = number_fault(fields[3], value); !what.empty())
      return fault("value", fields[3], what);
    digits_ = std::max(digits_, significant_digits(fields[3]));
    largest_ = std::max(largest_, std::abs(value));
    add({*time_s, value, lines.number()}, fields[1], lines, faults);
  }

  /// Checks the updates. `metres_per_value`: unit of the values.
  void check(double metres_per_value, std::size_t last_line, Faults& faults) {
    if (updates_.empty())
      return faults.add(last_line, 1, pv_,
                        fmt::format("no value of {}: is the name right?", axis_));
    constexpr std::size_t kDigitsOfCamonitor = 6;
    constexpr double kLargestStep_m = 1.01e-6;
    if (digits_ > kDigitsOfCamonitor || largest_ == 0.0) return;
    const double step = std::pow(10.0, std::floor(std::log10(largest_)) + 1.0 - kDigitsOfCamonitor);
    if (step * metres_per_value > kLargestStep_m)
      faults.add(updates_.front().line, 1, pv_,
                 fmt::format("the values have at most {} digits, a step of {:g} um: {}", digits_,
                             1e6 * step * metres_per_value, kLogAgain));
  }

  void find_longest_interval() {
    std::vector<double> intervals_s;
    for (std::size_t i = 1; i < updates_.size(); ++i)
      intervals_s.push_back(updates_[i].time_s - updates_[i - 1].time_s);
    if (intervals_s.empty()) return;
    const auto middle = intervals_s.begin() + static_cast<std::ptrdiff_t>(intervals_s.size() / 2);
    std::ranges::nth_element(intervals_s, middle);
    longest_s_ = kLongestMedians * *middle;
  }

  /// The value at `time_s`; nullopt if it is not known. Call it with ascending times.
  std::optional<double> at(double time_s) {
    if (updates_.empty() || time_s < updates_.front().time_s) return std::nullopt;
    while (next_ < updates_.size() && updates_[next_].time_s <= time_s) ++next_;
    const Update& before = updates_[next_ - 1];
    if (before.time_s == time_s || next_ == updates_.size()) return before.value;

    const Update& after = updates_[next_];
    const double interval_s = after.time_s - before.time_s;
    if (interval_s <= longest_s_)
      return before.value + (after.value - before.value) * (time_s - before.time_s) / interval_s;
    if (time_s <= after.time_s - longest_s_) return before.value;
    return std::nullopt;
  }

 private:
  void add(const Update& update, std::string_view at, const TextLines& lines, Faults& faults) {
    const Update* before = updates_.empty() ? nullptr : &updates_.back();
    if (before != nullptr && update.time_s < before->time_s)
      return faults.add_kind(
          "back", lines.number(), lines.column(at), pv_,
          fmt::format("the time goes back by {:.6g} s from line {}: the clock was set, or daylight "
                      "saving time ended; use the lines of one side",
                      before->time_s - update.time_s, before->line));
    if (before != nullptr && update.time_s == before->time_s) {
      if (update.value != before->value)
        faults.add_kind(
            "same time", lines.number(), lines.column(at), pv_,
            fmt::format("another value at the time of line {}: delete one of them", before->line));
      return;  // only an alarm has changed, or this is the first line after a new subscription
    }
    updates_.push_back(update);
  }

  char axis_;
  std::string pv_;
  std::vector<Update> updates_;
  std::size_t digits_ = 0, next_ = 0;
  double largest_ = 0.0, longest_s_ = 0.0;
};

using LogAxes = std::array<AxisUpdates, 3>;

LogAxes read_updates(std::string_view text, const CamonitorOptions& options, Faults& faults) {
  LogAxes axes{AxisUpdates(kAxisNames[0], options.pvs[0]),
               AxisUpdates(kAxisNames[1], options.pvs[1]),
               AxisUpdates(kAxisNames[2], options.pvs[2])};
  TextLines lines(text);
  while (lines.next()) {
    const auto fields = fields_of(lines.line());
    for (AxisUpdates& axis : axes)
      if (fields[0] == axis.pv()) axis.read(lines, fields, faults);
  }

  check_last_newline(text, lines.number(), faults);
  if (faults.any()) return axes;
  for (AxisUpdates& axis : axes) axis.check(options.metres_per_value, lines.number(), faults);
  return axes;
}

/// The times of all updates, ascending, each time once.
std::vector<Update> times_of_updates(const LogAxes& axes) {
  std::vector<Update> times;
  for (const AxisUpdates& axis : axes)
    times.insert(times.end(), axis.all().begin(), axis.all().end());
  std::ranges::stable_sort(times, {}, &Update::time_s);
  const auto same_time = [](const Update& a, const Update& b) { return a.time_s == b.time_s; };
  times.erase(std::unique(times.begin(), times.end(), same_time), times.end());
  return times;
}

void add_rows(LogAxes& axes, double metres_per_value, EncoderFile& out) {
  for (AxisUpdates& axis : axes) axis.find_longest_interval();
  for (const Update& update : times_of_updates(axes)) {
    AxisPosition reading_m{};
    bool known = true;
    for (std::size_t a = 0; a < axes.size(); ++a) {
      const auto value = axes[a].at(update.time_s);
      known = known && value.has_value();
      reading_m[a] = value.value_or(0.0) * metres_per_value;
    }
    if (!known) continue;

    if (out.rows.empty()) {
      out.times.first_time_s = update.time_s;
      out.times.first_line = update.line;
    }
    out.times.last_line = update.line;
    out.rows.push_back({update.time_s - out.times.first_time_s, reading_m});
  }
}

}  // namespace

bool is_camonitor_log(std::string_view text) {
  TextLines lines(text);
  if (!lines.next()) return false;
  const auto fields = fields_of(lines.line());
  if (fields.size() < 3) return false;
  return fields[1] == "***" || stamp_in(fields[1], fields[2]).has_value();
}

std::vector<std::string> pvs_of_log(std::string_view text, std::size_t most) {
  std::vector<std::string> pvs;
  for (TextLines lines(text); lines.next() && pvs.size() < most;) {
    const auto name = fields_of(lines.line()).front();
    if (std::ranges::find(pvs, name) == pvs.end()) pvs.emplace_back(name);
  }
  return pvs;
}

Result<EncoderFile> parse_camonitor_log(std::string_view text, const std::filesystem::path& file,
                                        const CamonitorOptions& options) {
  Faults faults(file.string());
  if (is_no_text(text, faults)) return tl::make_unexpected(faults.to_error());
  auto axes = read_updates(text, options, faults);
  if (faults.any()) return tl::make_unexpected(faults.to_error());

  EncoderFile out{{file.filename().string(), sha256_hex(text)}, {}, {}};
  add_rows(axes, options.metres_per_value, out);
  if (!out.rows.empty()) return out;
  faults.add(1, 1, "", "at no time all three axes have a value");
  return tl::make_unexpected(faults.to_error());
}

}  // namespace abbe::daemon
