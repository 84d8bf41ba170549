#include "abbe/calib/internal/otf/samples/standstill.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "samples/sample_windows.hpp"
#include "samples/standstill_statistics.hpp"

namespace abbe::calib::otf {
namespace {

enum class StreamState : unsigned char { Unknown, Stands, Moves };

/// First and last sample of a standstill; the target stands still at both.
struct Stretch {
  std::size_t first = 0, last = 0;
};

Result<void> check_samples(std::span<const TrackerObservation> samples) {
  constexpr std::size_t kFewest = 4;
  if (samples.size() < kFewest) {
    return failure(ErrorCode::TooFewObservations,
                   message("standstills: ", samples.size(), " samples, needs at least ", kFewest));
  }

  for (std::size_t i = 0; i < samples.size(); ++i) {
    const TrackerObservation& s = samples[i];
    if (!std::isfinite(s.time_s) || (s.valid && !s.p_tracker_m.allFinite())) {
      return failure(ErrorCode::NotFinite,
                     message("standstills: sample ", i, " at ", s.time_s, " s is not a number"));
    }
    if (i > 0 && !(s.time_s > samples[i - 1].time_s)) {
      return failure(ErrorCode::BadInput,
                     message("standstills: sample ", i, " at ", s.time_s, " s follows ",
                             samples[i - 1].time_s, " s, time must ascend"));
    }
  }

  return {};
}

/// Decides for each sample, from the windows around it, whether the target stands still.
class SpeedTest {
 public:
  SpeedTest(std::span<const TrackerObservation> samples, const StandstillOptions& options)
      : times_(sample_times(samples)),
        sigma_m_(sample_noise_m(samples)),
        windows_(samples, sigma_m_),
        window_s_(std::max(options.window_s, kFewestInWindow * times_.period_s)),
        least_speed_m_per_s_(options.stand_speed_m_per_s) {}

  /// States of all samples, computed in one pass.
  [[nodiscard]] std::vector<StreamState> states() const {
    const std::vector<double>& t = times_.time_s;
    const std::size_t n = t.size();
    std::vector<StreamState> states(n, StreamState::Unknown);
    std::size_t begin = 0, end = 0;

    for (std::size_t i = 0; i < n; ++i) {
      while (t[begin] <= t[i] - window_s_ + kRounding_s) {
        ++begin;
      }
      while (end < n && t[end] < t[i] + window_s_ - kRounding_s) {
        ++end;
      }
      states[i] = state(begin, i, end);
    }

    // Samples near the ends of the stream have only one complete window.
    fill_ends(states);
    return states;
  }

  /// True if the target is at the same place at both samples, between which its state is unknown.
  [[nodiscard]] bool same_place(std::size_t before, std::size_t after) const {
    const std::vector<double>& t = times_.time_s;
    std::size_t begin = before, end = after + 1;
    while (begin > 0 && t[begin - 1] > t[before] - window_s_) {
      --begin;
    }
    while (end < t.size() && t[end] < t[after] + window_s_) {
      ++end;
    }
    const std::size_t left = windows_.count(begin, before + 1), right = windows_.count(after, end);
    constexpr double kSamePlace_m = 20e-6;
    return left > 0 && right > 0 &&
           (windows_.mean_m(after, end) - windows_.mean_m(begin, before + 1)).norm() <=
               std::max(kSamePlace_m, kOfNoise * noise_m(left, right));
  }

  [[nodiscard]] const SampleTimes& times() const { return times_; }
  [[nodiscard]] double sigma_m() const { return sigma_m_; }
  [[nodiscard]] double speed_limit_m_per_s() const {
    const auto n = static_cast<std::size_t>(std::lround(window_s_ / times_.period_s));
    return limit_m(n, n) / window_s_;
  }

 private:
  static constexpr double kFewestInWindow = 2.0, kOfNoise = 4.0, kRounding_s = 1e-9;

  [[nodiscard]] double noise_m(std::size_t before, std::size_t after) const {
    return sigma_m_ *
           std::sqrt(3.0 / static_cast<double>(before) + 3.0 / static_cast<double>(after));
  }
  [[nodiscard]] double limit_m(std::size_t before, std::size_t after) const {
    return std::max(least_speed_m_per_s_ * window_s_, kOfNoise * noise_m(before, after));
  }

  /// State at sample i from the windows [begin, i] and [i, end). Unknown if one of them contains
  /// less than half of its samples.
  [[nodiscard]] StreamState state(std::size_t begin, std::size_t i, std::size_t end) const {
    const std::size_t before = windows_.count(begin, i + 1), after = windows_.count(i, end);
    const double needed = std::max(kFewestInWindow, 0.5 * window_s_ / times_.period_s);
    if (static_cast<double>(before) < needed || static_cast<double>(after) < needed) {
      return StreamState::Unknown;
    }
    const double moved_m = (windows_.mean_m(i, end) - windows_.mean_m(begin, i + 1)).norm();
    return moved_m <= limit_m(before, after) ? StreamState::Stands : StreamState::Moves;
  }

  /// Samples less than a window from an end of the stream get the state one window from it.
  void fill_ends(std::vector<StreamState>& states) const {
    const std::vector<double>& t = times_.time_s;
    std::size_t first = 0, last = t.size() - 1;
    while (first < last && t[first] < t.front() + window_s_) {
      ++first;
    }
    while (last > first && t[last] > t.back() - window_s_) {
      --last;
    }
    for (std::size_t i = 0; i < first; ++i) {
      states[i] = states[first];
    }
    for (std::size_t i = last + 1; i < t.size(); ++i) {
      states[i] = states[last];
    }
  }

  SampleTimes times_;
  double sigma_m_ = 0.0;
  SampleWindows windows_;
  double window_s_ = 0.0, least_speed_m_per_s_ = 0.0;
};

/// Sequences of samples at which the target stands still. A sequence continues over a short time of
/// unknown state if the target is at the same place after it.
std::vector<Stretch> stretches(const SpeedTest& test, double longest_break_s) {
  const std::vector<StreamState> states = test.states();
  const std::vector<double>& t = test.times().time_s;
  std::vector<Stretch> all;
  bool open = false;

  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states[i] == StreamState::Moves) {
      open = false;
    }
    if (states[i] != StreamState::Stands) {
      continue;
    }
    const bool successive = open && all.back().last + 1 == i;
    const bool short_break = open && t[i] - t[all.back().last] <= longest_break_s;
    if ((successive && short_break) || (short_break && test.same_place(all.back().last, i))) {
      all.back().last = i;
    } else {
      all.push_back({i, i});
    }
    open = true;
  }

  return all;
}

/// The first sample after the machine has settled.
std::size_t settled(const Stretch& s, std::span<const double> time_s, double settle_s) {
  constexpr double kLongEnough = 3.0;
  std::size_t first = s.first;
  if (time_s[s.last] - time_s[s.first] >= kLongEnough * settle_s) {
    while (time_s[first] < time_s[s.first] + settle_s) {
      ++first;
    }
  }
  return first;
}

bool has_valid_samples(std::span<const TrackerObservation> samples) {
  constexpr std::ptrdiff_t kFewestInMean = 3;  // with fewer samples, mean and slope leave no degree
                                               // of freedom
  return std::count_if(samples.begin(), samples.end(),
                       [](const TrackerObservation& s) { return s.valid; }) >= kFewestInMean;
}

/// Explains why a file with one mean for each standstill cannot be used; empty if the samples are
/// dense enough.
std::string means_text(double period_s, double least_duration_s) {
  if (!(period_s > least_duration_s)) {
    return "";
  }
  return message(": one row each ", period_s,
                 " s. If each row is the mean of a standstill: means are not read, because they do "
                 "not show their scatter; export every measurement, at least 3 in ",
                 least_duration_s, " s of each stop");
}

}  // namespace

Result<Standstills> find_standstills(std::span<const TrackerObservation> samples,
                                     const StandstillOptions& options) {
  ABBE_TRY(check_samples(samples));

  const SpeedTest test(samples, options);
  const std::vector<double>& time_s = test.times().time_s;
  MeanVariances variances;
  Standstills all{.period_s = test.times().period_s,
                  .sigma_m = test.sigma_m(),
                  .speed_limit_m_per_s = test.speed_limit_m_per_s(),
                  .samples = samples.size()};
  all.lost_samples = static_cast<std::size_t>(std::count_if(
      samples.begin(), samples.end(), [](const TrackerObservation& s) { return !s.valid; }));

  for (const Stretch& s : stretches(test, options.longest_break_s)) {
    const std::size_t first = settled(s, time_s, options.settle_s);
    if (time_s[s.last] - time_s[s.first] < options.least_duration_s ||
        !has_valid_samples(samples.subspan(first, s.last - first + 1))) {
      ++all.too_short;
      continue;
    }
    StandstillSamples one = standstill_of(samples, time_s, first, s.last);
    if (!(one.standstill.creep_m.norm() <= options.most_creep_m)) {
      ++all.creeping;
      continue;
    }
    variances.add(one.residual_m);
    all.found.push_back(std::move(one.standstill));
  }

  if (all.found.empty()) {
    return failure(
        ErrorCode::TooFewObservations,
        message("standstills: none in ", samples.size(), " samples, from ", time_s.front(), " to ",
                time_s.back(), " s: the target stands below ", 1e3 * all.speed_limit_m_per_s,
                " mm/s for ", options.least_duration_s, " s; ", all.too_short,
                " stops were shorter", means_text(all.period_s, options.least_duration_s)));
  }

  all.correlation = variances.correlation();
  return all;
}

}  // namespace abbe::calib::otf
