#pragma once
/// The last minutes and hours of the values that the page draws as curves. Each curve is kept in
/// three windows; in each a ring of buckets has the smallest, largest and mean value of one step,
/// so that the memory is bounded: kMostCurves curves of 1743 buckets of 40 bytes, 4.5 MB.
/// Thread-safe.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::web {

/// Which curve, and what it is drawn with.
struct CurveName {
  std::string group;  ///< curves of a group have one chart and one unit
  std::string name;
  std::string unit;
};

/// What can be asked for.
struct CurveWindow {
  std::string_view name;
  std::chrono::seconds length, step;
  /// One more than fit, for the bucket that is not complete.
  [[nodiscard]] constexpr std::size_t buckets() const {
    return static_cast<std::size_t>(length / step) + 1;
  }
};

class CurveHistory {
 public:
  using Clock = std::chrono::steady_clock;

  static constexpr std::array<CurveWindow, 3> kWindows{
      {{"5min", std::chrono::minutes{5}, std::chrono::seconds{1}},
       {"1h", std::chrono::hours{1}, std::chrono::seconds{5}},
       {"8h", std::chrono::hours{8}, std::chrono::seconds{40}}}};
  static constexpr std::size_t kMostCurves = 64;
  /// Without a value for longer there is a gap. The page reports lost values after this time, too.
  static constexpr std::chrono::seconds kGap{3};

  /// A value of now. One that is not finite is none. A curve beyond kMostCurves replaces one that
  /// has no value in any window; if there is none, the value is not kept.
  void add(const CurveName& curve, double value, Clock::time_point now);

  /// The buckets of a window from number `since` on, as JSON: {"window", "step_s", "buckets",
  /// "first": number of the first bucket, "length": how many there are, "now_s": the time now, from
  /// the beginning of bucket 0, "now": the same as RFC 3339, "left_out": whether values of further
  /// curves were not kept,
  /// "curves": [{"group", "name", "unit", "min": [], "max": [], "mean": [], "gaps": []}]}. null: no
  /// value in this step. gaps: numbers of buckets that have a gap, or follow one. `since` that is
  /// too old, or in the future: the whole window. nullopt: there is no such window.
  [[nodiscard]] std::optional<std::string> window(std::string_view name, std::int64_t since,
                                                  Clock::time_point now) const;

 private:
  struct Bucket {
    std::int64_t number = -1;  ///< of the step since the epoch of the clock; -1: empty
    double min = 0.0, max = 0.0, sum = 0.0;
    std::uint32_t count = 0;
    bool gap = false;
  };
  struct Curve {
    CurveName name;
    std::optional<Clock::time_point> last;  ///< value
    std::array<std::vector<Bucket>, kWindows.size()> rings;
  };

  [[nodiscard]] Curve* find_or_add(const CurveName& name, Clock::time_point now);

  mutable std::mutex mutex_;  // of the following members
  std::vector<Curve> curves_;
  bool left_out_ = false;
};

}  // namespace abbe::web
