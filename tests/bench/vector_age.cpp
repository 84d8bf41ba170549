// By how much subscribers understate the age of the vectors that they apply: the true age when they
// decide, less the age by which they decide. Both example subscribers, two machines, without keys
// and with, through kills of a machine and stops of abbe-dds and of the subscribers. A subscriber
// cannot know the delay of the fastest vector, so the plain Fast DDS hop of the same run is printed
// beside. As root the subscribers have real-time priority; else other load on the computer counts
// against them.
//   bench_vector_age [--short]
#include <fmt/format.h>
#include <stdlib.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "abbe/messages/dds_security.hpp"
#include "dds_hop.hpp"
#include "domain_claim.hpp"
#include "feeder_command.hpp"
#include "live_truth.hpp"

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
using test::LiveTruth;
namespace fs = std::filesystem;

constexpr double kLimit_ms = 1.0;  // required
constexpr std::chrono::milliseconds kVectorPeriod{10};

/// The folder of the sockets and keys, removed at the end.
class RunFolder {
 public:
  RunFolder() {
    std::string name = (fs::temp_directory_path() / "abbe-bench.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~RunFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// `keys`: empty: without keys.
LiveTruth::Parts parts(const fs::path& folder, const std::string& domain, const fs::path& keys,
                       bool real_time) {
  std::vector<std::string> of_abbe_dds;
  if (!keys.empty()) of_abbe_dds = {"--security", keys};
  auto subscribers = test::subscriber_commands(domain, keys, real_time);
  LiveTruth::Parts parts;
  parts.start_machine = [=](const std::string& machine) {
    return std::make_unique<test::Process>(
        test::feeder_command(folder, machine, domain, ABBE_LOOPBACK_PROFILE, of_abbe_dds));
  };
  parts.fast_subscriber = std::move(subscribers.fast);
  parts.cyclone_subscriber = std::move(subscribers.cyclone);
  parts.tolerance_ms = kLimit_ms;
  return parts;
}

/// True if the limit is met and all subscribers applied again after every disturbance.
bool measure(std::string_view what, LiveTruth::Parts parts, int rounds,
             const bench::HopResult& hop) {
  LiveTruth truth(std::move(parts));
  if (!truth.begin()) {
    fmt::print(stderr, "bench_vector_age: {}: the subscribers apply no vectors\n", what);
    return false;
  }

  for (int i = 0; i < rounds; ++i) {
    truth.round(LiveTruth::Blow::KillMachine, 1.6);
    truth.round(LiveTruth::Blow::StopAbbeDds, 3.0);
    truth.round(LiveTruth::Blow::StopSubscriber, 1.2);
  }

  const test::LiveTruthFigures f = truth.figures();
  for (const auto& failure : f.failures) fmt::print("  {}: {}\n", what, failure);
  const bool held = f.worst_understatement_ms <= kLimit_ms;
  fmt::print("  {:<13} {:>8} {:>6} {:>9.3f} {:>9.3f} {:>6.2f} {:>9.1f}  {}\n", what, f.applied,
             f.understated, kLimit_ms, f.worst_understatement_ms,
             f.worst_understatement_ms / kLimit_ms, 1e3 * f.worst_understatement_ms / hop.p50_us,
             held ? "held" : "MISSED");

  return held && f.applied > 0 && f.orphaned == 0;
}

int run(bool is_short) {
  // Forks: called before this process has threads.
  const auto hop = bench::measure_dds_hop({.samples = is_short ? 200u : 700u,
                                           .warm_up = 20,
                                           .period = kVectorPeriod,
                                           .profile = ABBE_LOOPBACK_PROFILE});
  if (hop.received == 0) {
    fmt::print(stderr, "bench_vector_age: the plain hop found no subscriber\n");
    return 1;
  }

  const test::DomainClaim domain;
  const RunFolder folder;
  const fs::path keys = folder.path() / "keys";
  if (const auto made = daemon::make_dds_keys({.folder = keys, .subscribers = 2},
                                              std::chrono::system_clock::now());
      !made) {
    fmt::print(stderr, "bench_vector_age: {}\n", made.error().text);
    return 1;
  }

  const bool real_time = test::real_time_permitted();
  fmt::print("plain Fast DDS hop, {} B every {} ms: p50 {:.1f} us, p99 {:.1f} us; subscribers {}\n",
             bench::hop::kMessageBytes, kVectorPeriod.count(), hop.p50_us, hop.p99_us,
             real_time ? "at SCHED_FIFO" : "without real-time priority");
  fmt::print("  {:<13} {:>8} {:>6} {:>9} {:>9} {:>6} {:>9}\n", "age", "applied", "beyond",
             "limit, ms", "worst, ms", "ratio", "to hop");
  const int rounds = is_short ? 1 : 5;
  const bool without =
      measure("without keys", parts(folder.path(), domain.text(), {}, real_time), rounds, hop);
  const bool with =
      measure("with keys", parts(folder.path(), domain.text(), keys, real_time), rounds, hop);
  return without && with ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  ::setenv("CYCLONEDDS_URI", "file://" ABBE_CYCLONE_CONFIG, 1);
  return run(argc > 1 && std::string_view(argv[1]) == "--short");
}
