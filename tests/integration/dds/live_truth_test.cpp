// Two machines on one domain: no subscriber keeps the state ACTIVE of a machine that has ended for
// more than 1.5 s, none applies a vector by an age that leaves out a stop or an outage, and all
// receive data again. A few rounds; `scripts/soak live-truth` runs ABBE_LIVE_TRUTH_ROUNDS random
// ones. By how much an age is understated is measured by `scripts/bench vector_age`.
#include "live_truth.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "figure.hpp"
#include "sample_messages.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

class LiveTruthTest : public ShopFloor {
 protected:
  /// While a program is stopped, vectors wait longer than their validity. An age that leaves out
  /// this wait is understated by more than the validity: the vector is applied although it has
  /// expired.
  [[nodiscard]] LiveTruth::Parts parts() const {
    const double validity_ms = 1e-6 * static_cast<double>(compensation(1).validity_ns());
    std::vector<std::string> of_abbe_dds;
    if (!keys_.empty()) of_abbe_dds = {"--security", keys_};
    auto subscribers = subscriber_commands(domain_.text(), keys_, real_time_);
    return {[this, of_abbe_dds](const std::string& name) { return feeder_of(name, of_abbe_dds); },
            std::move(subscribers.fast), std::move(subscribers.cyclone), own_network_, validity_ms};
  }
  void report(const LiveTruthFigures& f) const {
    const std::string keys = keys_.empty() ? "" : ", with keys";
    for (const auto& failure : f.failures) fmt::print("  {}\n", failure);
    tests::print_figure(
        "an ACTIVE of a dead machine, two machines, kills, stops and outages" + keys, "<= 1.5 s",
        "{:.2f} s at most, {} longer, {} rounds", f.longest_hold_s, f.held_too_long, f.rounds);
    tests::print_figure("vectors applied although they had expired" + keys, "0",
                        "{} of {}; ages understated by {:.3f} ms at most", f.understated, f.applied,
                        f.worst_understatement_ms);
    tests::print_figure("subscribers orphaned" + keys, "0",
                        "{}; all apply again after {:.2f} s at most", f.orphaned,
                        f.longest_return_s);
  }
  void expect_truth(const LiveTruthFigures& f) const {
    report(f);
    EXPECT_EQ(f.held_too_long, 0);
    // Else a subscriber may be stopped between its decision and the stamp of its line.
    if (real_time_) {
      EXPECT_EQ(f.understated, 0u);
    }
    EXPECT_EQ(f.orphaned, 0);
    EXPECT_GT(f.applied, 0u);
  }

  void hold_through_kills_stops_and_an_outage() {
    LiveTruth truth(parts());
    ASSERT_TRUE(truth.begin());
    truth.round(LiveTruth::Blow::KillMachine, 1.6);
    truth.round(LiveTruth::Blow::StopAbbeDds, 3.0);
    truth.round(LiveTruth::Blow::StopSubscriber, 1.2);
    if (own_network_) truth.round(LiveTruth::Blow::Outage, 4.0);
    expect_truth(truth.figures());
  }
  /// With keys Fast DDS and Cyclone DDS authenticate a participant again only after they dropped it
  /// themselves: no participant may drop another within 30 s.
  void hold_through_the_longest_stops_and_outage() {
    if (std::getenv("ABBE_LIVE_TRUTH_ROUNDS") == nullptr) GTEST_SKIP() << "scripts/soak live-truth";
    LiveTruth truth(parts());
    ASSERT_TRUE(truth.begin());
    truth.round(LiveTruth::Blow::StopAbbeDds, 30.0);
    truth.round(LiveTruth::Blow::StopSubscriber, 30.0);
    if (own_network_) truth.round(LiveTruth::Blow::Outage, 30.0);
    expect_truth(truth.figures());
  }
  void hold_for_random_rounds() {
    const char* const rounds = std::getenv("ABBE_LIVE_TRUTH_ROUNDS");
    if (rounds == nullptr) GTEST_SKIP() << "scripts/soak live-truth";
    const char* const given = std::getenv("ABBE_LIVE_TRUTH_SEED");
    const auto seed = given != nullptr ? static_cast<unsigned>(std::atoi(given)) : 1u;
    std::mt19937 random(seed);
    LiveTruth truth(parts());
    ASSERT_TRUE(truth.begin());

    while (truth.figures().rounds < std::atoi(rounds)) {
      truth.random_round(random);
      const auto so_far = truth.figures();
      fmt::print("  round {}: held {:.2f} s, understated {:.3f} ms ({}), orphaned {}\n",
                 so_far.rounds, so_far.longest_hold_s, so_far.worst_understatement_ms,
                 so_far.understated, so_far.orphaned);
      std::fflush(stdout);
    }

    fmt::print("seed {}\n", seed);
    expect_truth(truth.figures());
  }

  std::filesystem::path keys_;  ///< empty: without
  bool own_network_ = enter_own_network();
  bool real_time_ = real_time_permitted();
};

TEST_F(LiveTruthTest, HoldsThroughKillsStopsAndAnOutage) {
  hold_through_kills_stops_and_an_outage();
}

/// Longer than the lease that Fast DDS gives a participant by default: abbe-dds would drop it, but
/// not it abbe-dds.
TEST_F(LiveTruthTest, EverySubscriberReconnectsAfterALongPause) {
  LiveTruth truth(parts());
  ASSERT_TRUE(truth.begin());
  truth.round(LiveTruth::Blow::StopSubscriber, 22.0);
  expect_truth(truth.figures());
}

TEST_F(LiveTruthTest, HoldsThroughTheLongestStopsAndOutage) {
  hold_through_the_longest_stops_and_outage();
}

TEST_F(LiveTruthTest, HoldsForRandomRounds) {
  hold_for_random_rounds();
}

/// DDS Security on, with one authority for both machines.
class LiveTruthWithKeys : public LiveTruthTest {
 protected:
  void SetUp() override { keys_ = make_keys("keys"); }
};

TEST_F(LiveTruthWithKeys, HoldsThroughKillsStopsAndAnOutage) {
  hold_through_kills_stops_and_an_outage();
}

TEST_F(LiveTruthWithKeys, HoldsThroughTheLongestStopsAndOutage) {
  hold_through_the_longest_stops_and_outage();
}

TEST_F(LiveTruthWithKeys, HoldsForRandomRounds) {
  hold_for_random_rounds();
}

}  // namespace
}  // namespace abbe::test
