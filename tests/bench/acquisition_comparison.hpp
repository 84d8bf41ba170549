#pragma once
/// Compares phases of a run with requests (of programs or pages) to those without. The peer is the
/// same comparison between the odd and the even phases without requests: it shows what other load
/// on the computer changes.

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <string>

#include "acquisition_phase.hpp"
#include "figure.hpp"

namespace abbe::bench {

/// In order of severity.
enum class Outcome { Met, Inconclusive, Missed };

inline Outcome worse(Outcome a, Outcome b) {
  return std::max(a, b);
}

inline int exit_code(Outcome outcome) {
  constexpr int kMissed = 1, kInconclusive = 3;
  return outcome == Outcome::Met ? 0 : outcome == Outcome::Missed ? kMissed : kInconclusive;
}

/// A figure with and without requests [us], as a ratio to that without.
struct Compared {
  double quiet_odd = 0.0, quiet_even = 0.0, quiet = 0.0, requested = 0.0;

  [[nodiscard]] bool has_data() const {
    return std::min({quiet_odd, quiet_even, quiet, requested}) > 0.0;
  }
  [[nodiscard]] double ratio() const { return requested / quiet; }
  /// At least 1.
  [[nodiscard]] double peer() const {
    return std::max(quiet_odd, quiet_even) / std::min(quiet_odd, quiet_even);
  }
  /// The limit is a bucket of the histogram, or the peer if it is larger. With a peer above 1.5
  /// the computer is too busy for a statement. Delays below 0.1 us, a third of what most calls
  /// of receive() take, have no useful ratio.
  [[nodiscard]] Outcome outcome() const {
    constexpr double kBucket = 1.26, kMostPeer = 1.5;  // the widest bucket: 1.25, plus rounding
    constexpr double kShortest_us = 0.1;
    if (has_data() && std::max(requested, quiet) < kShortest_us) return Outcome::Met;
    if (!has_data() || peer() > kMostPeer) return Outcome::Inconclusive;
    return ratio() <= std::max(kBucket, peer()) ? Outcome::Met : Outcome::Missed;
  }
};

/// The phases of one acquisition thread.
struct AcquisitionComparison {
  AcquisitionPhase quiet_odd, quiet_even, requested;

  [[nodiscard]] AcquisitionPhase quiet() const {
    AcquisitionPhase all = quiet_odd;
    add(all, quiet_even);
    return all;
  }
  template <class Figure>
  [[nodiscard]] Compared of(Figure figure) const {
    return {std::invoke(figure, quiet_odd), std::invoke(figure, quiet_even),
            std::invoke(figure, quiet()), std::invoke(figure, requested)};
  }
  /// The phases with requests last as long as those without.
  [[nodiscard]] Outcome outcome_of_losses() const {
    if (requested.lost <= quiet().lost) return Outcome::Met;
    return requested.lost > 2 * quiet().lost ? Outcome::Missed : Outcome::Inconclusive;
  }
};

inline const char* suffix(Outcome outcome) {
  return outcome == Outcome::Inconclusive ? ", INCONCLUSIVE: too much other load, or no data"
         : outcome == Outcome::Missed     ? ", NOT MET"
                                          : "";
}

inline Outcome report_ratio(const std::string& what, const Compared& of) {
  tests::print_figure(what, "ratio 1",
                      "{:.2f} us without requests, {:.2f} us with, ratio {:.2f}, "
                      "without requests among themselves {:.2f}{}",
                      of.quiet, of.requested, of.ratio(), of.peer(), suffix(of.outcome()));
  return of.outcome();
}

inline Outcome report_acquisition(const std::string& stream, const AcquisitionComparison& of) {
  const auto receive = [](double share) {
    return [share](const AcquisitionPhase& phase) { return quantile_us(phase.receive, share); };
  };
  const Compared median = of.of(receive(0.5));
  fmt::print("{}: time in receive(), median: without requests {:.1f} us, with {:.1f} us\n", stream,
             median.quiet, median.requested);

  const auto figure = [&stream](const char* what) { return fmt::format("{} of {}", what, stream); };
  Outcome outcome = report_ratio(figure("time in receive(), p99,"), of.of(receive(0.99)));
  outcome =
      worse(outcome, report_ratio(figure("time in receive(), p99.9,"), of.of(receive(0.999))));
  outcome = worse(outcome, report_ratio(figure("mean scheduling delay"),
                                        of.of(&AcquisitionPhase::mean_delay_us)));
  tests::print_figure(figure("gaps and dropped samples"), "no more than without requests",
                      "{} without requests, {} with{}", of.quiet().lost, of.requested.lost,
                      suffix(of.outcome_of_losses()));

  return worse(outcome, of.outcome_of_losses());
}

}  // namespace abbe::bench
