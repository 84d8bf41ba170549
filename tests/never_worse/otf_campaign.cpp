// Random machines with every fault of a shop floor, two at a time.  never_worse_otf [MACHINES [FIRST_SEED
// [FAULT...]]] Prints for every fault how many models were accepted, how many of these make the machine
// worse, how many are wrong by more than three times their stated uncertainty, and how often the fault is the
// cause named first. Exit code 1: one of the limits of issue "never worse" is not kept.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <vector>

#include "figure.hpp"
#include "otf_run.hpp"

using namespace abbe::tests::never_worse;

namespace {

struct Tally {
  int runs = 0, accepted = 0, worse = 0, too_sure = 0, named = 0;
  double left_over_u = 0.0, largest_left_over_u = 0.0;
  std::size_t covered = 0, intervals = 0;
  std::string other_reason;
};

bool names(const std::string& reason, const std::vector<std::string>& causes) {
  return causes.empty() || std::any_of(causes.begin(), causes.end(), [&](const std::string& cause) {
           return reason.find(cause) != std::string::npos;
         });
}

void count(Tally& t, const Outcome& o, const Fault& fault) {
  ++t.runs;
  if (!o.accepted) {
    names(o.first_reason, fault.causes) ? void(++t.named) : void(t.other_reason = o.first_reason);
    return;
  }
  ++t.accepted;
  t.worse += o.left_m > o.before_m;
  t.too_sure += o.left_m > 3.0 * o.u_m;
  t.left_over_u += o.left_m / o.u_m;
  t.covered += o.covered;
  t.intervals += o.intervals;
  t.largest_left_over_u = std::max(t.largest_left_over_u, o.left_m / o.u_m);
}

}  // namespace

int main(int argc, char** argv) {
  const int machines = argc > 1 ? std::atoi(argv[1]) : 20;
  const std::uint64_t first = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  std::vector<Fault> faults = otf_faults();
  if (argc > 3) {
    std::erase_if(faults, [&](const Fault& f) {
      return std::none_of(argv + 3, argv + argc,
                          [&](const char* part) { return f.name.find(part) != std::string::npos; });
    });
  }
  std::vector<Tally> tallies(faults.size());
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  const auto work = [&] {
    for (std::size_t i; (i = next++) < static_cast<std::size_t>(machines) * faults.size();) {
      const std::size_t fault = i % faults.size();
      OtfRun run = random_otf_run(first + i / faults.size());
      faults[fault].put_in(run);
      const Outcome outcome = identify_and_compare(std::move(run));
      const std::lock_guard lock{mutex};
      count(tallies[fault], outcome, faults[fault]);
      if (std::getenv("ABBE_NEVER_WORSE_VERBOSE") != nullptr)
        fmt::print("{} seed {}: {} before {:.2f} left {:.3f} u {:.3f} um sigma0 {:.2f} {}\n",
                   faults[fault].name, first + i / faults.size(), outcome.accepted ? "accepted" : "refused",
                   1e6 * outcome.before_m, 1e6 * outcome.left_m, 1e6 * outcome.u_m, outcome.sigma0,
                   outcome.first_reason);
    }
  };
  { std::jthread one{work}, two{work}; }
  fmt::print("{:<36} {:>5} {:>8} {:>6} {:>6} {:>10} {:>8} {:>7}\n", "fault", "runs", "accepted", "worse",
             "> 3 u", "left/u", "largest", "named");
  Tally all, seen;
  for (std::size_t i = 0; i < faults.size(); ++i) {
    const Tally& t = tallies[i];
    const int refused = t.runs - t.accepted;
    fmt::print("{:<36} {:>5} {:>8} {:>6} {:>6} {:>10.2f} {:>8.2f} {:>3}/{:<3} {}\n", faults[i].name, t.runs,
               t.accepted, t.worse, t.too_sure, t.accepted > 0 ? t.left_over_u / t.accepted : 0.0,
               t.largest_left_over_u, t.named, refused, t.other_reason.substr(0, 110));
    if (!faults[i].visible) continue;
    all.runs += t.runs, all.accepted += t.accepted, all.worse += t.worse, all.too_sure += t.too_sure;
    if (!faults[i].causes.empty()) seen.runs += refused, seen.named += t.named;
  }
  const auto faultless =
      std::find_if(faults.begin(), faults.end(), [](const Fault& f) { return f.name == "none"; });
  const Tally none =
      faultless == faults.end() ? Tally{} : tallies[static_cast<std::size_t>(faultless - faults.begin())];
  using abbe::tests::print_figure;
  print_figure("never worse, on the fly: accepted models that make the machine worse", "0",
               "{} of {} accepted of {} runs", all.worse, all.accepted, all.runs);
  print_figure("never worse, on the fly: accepted models wrong by more than 3 u", "0", "{}", all.too_sure);
  print_figure("never worse, on the fly: faultless runs accepted", ">= 97 %", "{} of {}", none.accepted,
               none.runs);
  print_figure("never worse, on the fly: 95 % intervals of faultless runs cover", "94 to 97 %", "{:.1f} %",
               none.intervals > 0
                   ? 100.0 * static_cast<double>(none.covered) / static_cast<double>(none.intervals)
                   : 0.0);
  print_figure("never worse, on the fly: cause named first", ">= 90 %", "{} of {} refused", seen.named,
               seen.runs);
  return all.worse + all.too_sure > 0 || none.accepted * 100 < 97 * none.runs ||
                 seen.named * 10 < 9 * seen.runs
             ? 1
             : 0;
}
