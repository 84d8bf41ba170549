#pragma once
/// Calibrates many random machines with each fault of a shop floor that is defined for a
/// calibration method, on two threads, and prints how many models the gate accepts and how good
/// these are. Arguments of the programs: [MACHINES [FIRST_SEED [PART OF A FAULT'S NAME...]]].

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "figure.hpp"

namespace abbe::tests::never_worse {

struct Outcome {
  bool accepted = false;
  std::string first_reason;
  std::string first_cause;  ///< first of Verdict::causes; empty if an error ended the run before
  double before_m = 0.0;    ///< mean |V| of the truth, without rigid motion
  double left_m = 0.0;      ///< mean |V of the model - true V|, without rigid motion
  double u_m = 0.0;         ///< mean stated standard uncertainty: root of the trace
  double sigma0 = 0.0;
  double misfit_m = 0.0;  ///< mean of the part of the uncertainty that is misfit: root of the trace
  std::size_t covered = 0, intervals = 0;  ///< components of V inside their 95 % interval
  /// Places at which the error that is left, without rigid motion, is at most U(V) (k = 2).
  std::size_t below_U = 0, places = 0;
};

/// Calls work(i) for i < count on two threads.
inline void on_two_threads(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  const auto take = [&] {
    for (std::size_t i; (i = next++) < count;) {
      work(i);
    }
  };
  const std::jthread one{take}, two{take};
}

inline Outcome refused(std::string reason) {
  Outcome o;
  o.first_reason = std::move(reason);
  return o;
}

/// The expected diagnosis of a fault: the cause of the first reason of a verdict, or words in the
/// text of an error before any verdict. Empty: no diagnosis is required.
struct Names {
  std::vector<std::string> causes{}, words{};

  [[nodiscard]] bool empty() const { return causes.empty() && words.empty(); }
  [[nodiscard]] bool hold(const Outcome& o) const {
    if (!o.first_cause.empty()) {
      return std::find(causes.begin(), causes.end(), o.first_cause) != causes.end();
    }
    return std::any_of(words.begin(), words.end(), [&](const std::string& word) {
      return o.first_reason.find(word) != std::string::npos;
    });
  }
};

template <class Run>
struct Fault {
  std::string name;
  std::function<void(Run&)> put_in;
  Names names;
  bool visible = true;  ///< false: no available data contradicts the fault
};

template <class Run>
struct Campaign {
  std::string_view method;
  std::vector<Fault<Run>> faults;
  std::function<Run(std::uint64_t seed)> random_run;
  std::function<Outcome(Run)> identify_and_compare;
};

struct Tally {
  int runs = 0, accepted = 0, worse = 0, too_sure = 0, named = 0;
  double left_over_u = 0.0, largest_left_over_u = 0.0;
  std::size_t covered = 0, intervals = 0;
  std::string other_reason;

  void count(const Outcome& o, const Names& names) {
    ++runs;
    if (!o.accepted) {
      const bool by_name = names.empty() || names.hold(o);
      by_name ? void(++named) : void(other_reason = o.first_cause + ": " + o.first_reason);
      return;
    }

    ++accepted;
    worse += o.left_m > o.before_m;
    too_sure += o.left_m > 3.0 * o.u_m;
    left_over_u += o.left_m / o.u_m;
    largest_left_over_u = std::max(largest_left_over_u, o.left_m / o.u_m);
    covered += o.covered;
    intervals += o.intervals;
  }
};

template <class Run>
std::vector<Tally> tallies_of(const Campaign<Run>& campaign, int machines,
                              std::uint64_t first_seed) {
  const std::size_t faults = campaign.faults.size();
  const bool verbose = std::getenv("ABBE_NEVER_WORSE_VERBOSE") != nullptr;
  std::vector<Tally> tallies(faults);
  std::mutex mutex;

  on_two_threads(static_cast<std::size_t>(machines) * faults, [&](std::size_t i) {
    const Fault<Run>& fault = campaign.faults[i % faults];
    const std::uint64_t seed = first_seed + i / faults;
    Run run = campaign.random_run(seed);
    fault.put_in(run);
    const Outcome o = campaign.identify_and_compare(std::move(run));
    const std::lock_guard lock{mutex};
    tallies[i % faults].count(o, fault.names);
    if (verbose) {
      fmt::print("{} seed {}: {} before {:.2f} left {:.3f} u {:.3f} um sigma0 {:.2f} {}: {}\n",
                 fault.name, seed, o.accepted ? "accepted" : "refused", 1e6 * o.before_m,
                 1e6 * o.left_m, 1e6 * o.u_m, o.sigma0, o.first_cause, o.first_reason);
    }
  });
  return tallies;
}

template <class Run>
void print_table(const Campaign<Run>& campaign, const std::vector<Tally>& tallies) {
  fmt::print("{:<40} {:>5} {:>8} {:>6} {:>6} {:>10} {:>8} {:>7}\n", "fault", "runs", "accepted",
             "worse", "> 3 u", "left/u", "largest", "named");
  for (std::size_t i = 0; i < tallies.size(); ++i) {
    const Tally& t = tallies[i];
    fmt::print("{:<40} {:>5} {:>8} {:>6} {:>6} {:>10.2f} {:>8.2f} {:>3}/{:<3} {}\n",
               campaign.faults[i].name, t.runs, t.accepted, t.worse, t.too_sure,
               t.accepted > 0 ? t.left_over_u / t.accepted : 0.0, t.largest_left_over_u, t.named,
               t.runs - t.accepted, t.other_reason.substr(0, 110));
  }
}

/// Prints the figures. Returns true if all limits are met.
template <class Run>
bool print_figures(const Campaign<Run>& campaign, const std::vector<Tally>& tallies) {
  Tally all, seen, none;
  for (std::size_t i = 0; i < tallies.size(); ++i) {
    const Tally& t = tallies[i];
    const Fault<Run>& fault = campaign.faults[i];
    if (fault.name == "none") none = t;
    if (!fault.visible) continue;
    all.runs += t.runs, all.accepted += t.accepted, all.worse += t.worse,
        all.too_sure += t.too_sure;
    if (!fault.names.empty()) seen.runs += t.runs - t.accepted, seen.named += t.named;
  }

  const auto figure = [&](std::string_view what) {
    return fmt::format("never worse, {}: {}", campaign.method, what);
  };

  print_figure(figure("accepted models with a larger error than no model"), "0",
               "{} of {} accepted of {} runs", all.worse, all.accepted, all.runs);
  print_figure(figure("accepted models wrong by more than 3 u"), "0", "{}", all.too_sure);
  print_figure(figure("runs without a fault accepted"), ">= 97 %", "{} of {}", none.accepted,
               none.runs);
  print_figure(figure("coverage of the 95 % intervals of runs without a fault"), "94 to 97 %",
               "{:.1f} %",
               none.intervals > 0
                   ? 100.0 * static_cast<double>(none.covered) / static_cast<double>(none.intervals)
                   : 0.0);
  print_figure(figure("refused runs whose first cause is the fault"), ">= 90 %", "{} of {} refused",
               seen.named, seen.runs);

  return all.worse + all.too_sure == 0 && none.accepted * 100 >= 97 * none.runs &&
         seen.named * 10 >= 9 * seen.runs;
}

/// Exit code: 0 if all limits are met, else 1.
template <class Run>
int run_campaign(Campaign<Run> campaign, int argc, char** argv) {
  const int machines = argc > 1 ? std::atoi(argv[1]) : 20;
  const std::uint64_t first_seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  if (argc > 3) {
    std::erase_if(campaign.faults, [&](const Fault<Run>& f) {
      return std::none_of(argv + 3, argv + argc,
                          [&](const char* part) { return f.name.find(part) != std::string::npos; });
    });
  }
  const std::vector<Tally> tallies = tallies_of(campaign, machines, first_seed);
  print_table(campaign, tallies);
  return print_figures(campaign, tallies) ? 0 : 1;
}

}  // namespace abbe::tests::never_worse
