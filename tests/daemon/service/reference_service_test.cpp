#include "abbe/service/reference_service.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "abbe/config/capabilities.hpp"
#include "config_tables.hpp"
#include "reference_cycle.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using drivers::MarkCrossing;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;
using ::testing::Contains;
using ::testing::HasSubstr;

const std::string kHalfMetreMill = to_toml(config_tables::half_metre_mill());
const std::string kCard = R"([counter_card]
transport = "usbip"
port = 3240
axes = [{axis = "X", channel = 0, step_nm = 250}, {axis = "Y", channel = 1, step_nm = 250},
        {axis = "Z", channel = 2, step_nm = 250, invert = true}]
)";

std::string reference(const std::string& more,
                      const std::string& axis = R"(axis = "Z", channel = 2)") {
  return "[reference]\ntransport = \"usbip\"\nport = 3241\nu_alignment_us = 1000\n" + more +
         "axes = [{" + axis + ", signal_period_um = 20, length_mm = 500, zero_mark_mm = 10}]\n";
}

Config reference_config_of(const std::string& text) {
  auto config = parse_config(kHalfMetreMill + text, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}
std::vector<std::string> reference_faults_of(const std::string& text) {
  const auto config = parse_config(kHalfMetreMill + text, "abbed.toml");
  return config ? std::vector<std::string>{} : config.error().details;
}

TEST(ReferenceConfig, TakesTheStepFromTheCardThatCountsLive) {
  const auto config = reference_config_of(kCard + reference(""));
  ASSERT_TRUE(config.of<ReferenceConfig>());
  const auto options = reference_options(*reference_marks(config), *counted_axes(config));
  ASSERT_EQ(options.axes.size(), 1u);
  EXPECT_EQ(options.axes[0].live_axis, 2);
  EXPECT_EQ(options.axes[0].latched_axis, 0);
  EXPECT_DOUBLE_EQ(options.axes[0].marks.counts_per_period, -80.0);
  EXPECT_EQ(options.axes[0].marks.code.length, 25'000);
  EXPECT_TRUE(config.of<ReferenceConfig>()->card.wiring.axes[0].latch_on_index);
}

TEST(ReferenceConfig, NeedsTheAxesCountedLiveByAnotherCard) {
  EXPECT_THAT(reference_faults_of(reference("")), Contains(HasSubstr("needs [counter_card]")));
  EXPECT_THAT(reference_faults_of(kCard + reference("", R"(axis = "A", channel = 2)")),
              Contains(HasSubstr("is not counted by [counter_card]")));
  EXPECT_THAT(
      reference_faults_of(kCard + "[reference]\ntransport = \"usbip\"\nport = 3240\naxes = []\n"),
      Contains(HasSubstr("is the card of [counter_card]")));
}

TEST(ReferenceConfig, RefusesAPeriodThatHoldsNoWholeNumberOfCounts) {
  const std::string odd =
      "[reference]\ntransport = \"usbip\"\nport = 3241\naxes = [{axis = \"X\", channel = 0, "
      "signal_period_um = 20.1, length_mm = 500}]\n";
  EXPECT_THAT(reference_faults_of(kCard + odd), Contains(HasSubstr("must be a whole number")));
}

TEST(ReferenceConfig, IsPartOfTheMachineHash) {
  EXPECT_NE(machine_hash(reference_config_of(kCard)),
            machine_hash(reference_config_of(kCard + reference(""))));
  EXPECT_EQ(machine_hash(reference_config_of(kCard + reference("tolerance_um = 2\n"))),
            machine_hash(reference_config_of(kCard + reference(""))));
}

/// Z of the machine, read by both cards at 1 kHz; counts fall as it rises. The scale's zero mark is
/// at 10 mm.
class Traverse {
 public:
  static constexpr double kStep_m = -250e-9;
  static constexpr double kLiveBegan_m = 0.12;  ///< where Z stood when the live card was set up
  static constexpr double kLatchBegan_m = 0.05;

  Traverse() {
    for (int k = 0; k < 25; ++k) {
      marks_m_.push_back(0.01 + 20e-6 * k * 1000);
      marks_m_.push_back(0.01 + 20e-6 * (k * 1000 + 500 + k + 1));
    }
  }
  /// One sample, and a mark if one was crossed.
  Batch step(double z_m) {
    Batch batch;
    now_ += 1ms;
    AxisSample& live = batch.axes.emplace_back();
    live.head.time = now_;
    live.axis_count = 3;
    live.count[2] = std::llround((z_m - kLiveBegan_m) / kStep_m);
    live.position[2] = kStep_m * static_cast<double>(live.count[2]);

    for (const double mark : marks_m_) {
      if ((before_m_ < mark) == (z_m < mark)) continue;
      batch.marks.push_back(
          {{.time = now_}, now_ - 1ms, 0, std::llround((mark - kLatchBegan_m) / kStep_m)});
    }

    before_m_ = z_m;
    return batch;
  }

 private:
  HostTime now_{100s};
  double before_m_ = 0.1;
  std::vector<double> marks_m_;
};

/// The last batch of a drive over 50 mm at 1 mm/s, with its readings.
Batch drive(ReferenceService& service, Traverse& traverse) {
  Batch batch;
  for (int i = 0; i < 50'000; ++i) {
    batch = traverse.step(0.1 + 1e-6 * i);
    give(service, batch);
  }
  return batch;
}

TEST(ReferenceService, AnAxisIsMissingUntilItsMarksWereFound) {
  const auto config = reference_config_of(kCard + reference("tolerance_um = 5\n"));
  ReferenceService service{config, nullptr};
  Traverse traverse;
  Batch batch = traverse.step(0.1);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask & 0b100, 0b100);
  EXPECT_TRUE(has(batch.axes[0].head.flags, SampleFlag::AxisMissing));
  EXPECT_FALSE(service.status().at(0).known);
}

TEST(ReferenceService, AReferencedAxisReadsTheMachinesPosition) {
  const auto config = reference_config_of(kCard + reference("tolerance_um = 5\n"));
  ReferenceService service{config, nullptr};
  ASSERT_TRUE(service.start());
  Traverse traverse;
  const Batch last = drive(service, traverse);
  ASSERT_FALSE(service.running()) << service.status().at(0).found.reason;
  EXPECT_EQ(last.axes[0].missing_mask & 0b100, 0);
  EXPECT_NEAR(last.axes[0].position[2], 0.1 + 1e-6 * 49'999, 5e-6);
  EXPECT_NEAR(service.status().at(0).reading_at_zero, Traverse::kLiveBegan_m, 5e-6);
}

TEST(ReferenceService, ACardThatRestartedHasNoZero) {
  const auto config = reference_config_of(kCard + reference("tolerance_um = 5\n"));
  ReferenceService service{config, nullptr};
  ASSERT_TRUE(service.start());
  Traverse traverse;
  drive(service, traverse);
  Batch batch = traverse.step(0.2);
  batch.axes[0].head.flags |= SampleFlag::Restarted;
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask & 0b100, 0b100);
  EXPECT_FALSE(service.status().at(0).known);
}

TEST(ReferenceService, RefusesWithoutMarksAndASecondTime) {
  const auto without = reference_config_of(kCard);
  ReferenceService none{without, nullptr};
  EXPECT_EQ(none.start().error().code, ErrorCode::Refused);
  const auto config = reference_config_of(kCard + reference(""));
  ReferenceService service{config, nullptr};
  EXPECT_EQ(service.cancel().error().code, ErrorCode::Refused);
  ASSERT_TRUE(service.start());
  EXPECT_EQ(service.start().error().code, ErrorCode::Refused);
  EXPECT_TRUE(service.cancel());
}

const std::string kHere = "zero = \"here\"\n";

/// A card as it is set up, and later: counts of Z, 4 to a micrometre, falling as Z rises.
Batch counts(HostTime t, std::int64_t count, bool restarted = false) {
  Batch batch;
  AxisSample& sample = batch.axes.emplace_back();
  sample.head.time = t;
  if (restarted) sample.head.flags |= SampleFlag::Restarted;
  sample.axis_count = 3;
  sample.count[2] = count;
  sample.position[2] = -250e-9 * static_cast<double>(count);
  return batch;
}

/// The card that was set up at 1 s, Z standing at `count` until 2 s.
void stand(ReferenceService& service, std::int64_t count) {
  for (int k = 0; k <= 10; ++k) {
    Batch batch = counts(HostTime{1s + k * 100ms}, count, k == 0);
    give(service, batch);
  }
}

SetZeroHere z_at(HostTime now) {
  return {.axes = {"Z"}, .now = now};
}

TEST(ReferenceService, AxesWithoutMarksAreUnreferencedUntilAZeroIsSet) {
  const auto config = reference_config_of(kCard);
  ReferenceService service{config, nullptr};

  EXPECT_EQ(service.set_zero_here({}).error().code, ErrorCode::Refused);
  stand(service, 400);
  EXPECT_THAT(service.without_zero(), ::testing::ElementsAre("X", "Y", "Z"));
  Batch batch = counts(HostTime{2s}, 400);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b111);
  ASSERT_TRUE(service.set_zero_here(z_at(HostTime{2s})));
  batch = counts(HostTime{3s}, 404);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b011);
  EXPECT_NEAR(batch.axes[0].position[2], -1e-6, 1e-15);  // two readings of 0.1 mm apart
  EXPECT_THAT(service.without_zero(), ::testing::ElementsAre("X", "Y"));
  EXPECT_EQ(service.unknown(), service.without_zero()) << "no axis of this card has marks";
}

TEST(ReferenceService, RefusesToSetTheZeroOfAMovingAxis) {
  const auto config = reference_config_of(kCard);
  ReferenceService service{config, nullptr};
  stand(service, 400);
  Batch batch = counts(HostTime{2s}, 440);
  give(service, batch);
  const auto moving = service.set_zero_here(z_at(HostTime{2s}));

  ASSERT_FALSE(moving);
  EXPECT_EQ(moving.error().code, ErrorCode::Refused);
  EXPECT_THAT(moving.error().text, HasSubstr("Z moves"));
  EXPECT_THAT(service.without_zero(), Contains("Z"));
  EXPECT_TRUE(service.set_zero_here({.axes = {"X"}, .now = HostTime{2s}}));
  batch = counts(HostTime{2500ms}, 441);  // a count to and fro is no motion
  give(service, batch);
  EXPECT_TRUE(service.set_zero_here(z_at(HostTime{2500ms})));
}

TEST(ReferenceService, RefusesToSetTheZeroWhileTheCardIsSilent) {
  const auto config = reference_config_of(kCard);
  ReferenceService service{config, nullptr};
  stand(service, 400);
  const auto silent = service.set_zero_here(z_at(HostTime{2600ms}));
  ASSERT_FALSE(silent);
  EXPECT_EQ(silent.error().code, ErrorCode::Refused);
  EXPECT_THAT(silent.error().text, HasSubstr("silent for 0.6 s"));
}

TEST(ReferenceService, NoZeroChangesDuringACalibration) {
  const auto config = reference_config_of(kCard);
  ReferenceService service{config, nullptr};
  stand(service, 400);
  auto here = z_at(HostTime{2s});
  here.acquiring = true;
  EXPECT_EQ(service.set_zero_here(here).error().code, ErrorCode::Refused);
  here.acquiring = false;
  EXPECT_TRUE(service.set_zero_here(here));
}

TEST(ReferenceService, RefusesAZeroWithoutUncertainty) {
  const auto config = reference_config_of(kCard);
  ReferenceService service{config, nullptr};
  stand(service, 400);
  auto here = z_at(HostTime{2s});
  EXPECT_GT(here.u, 0.0);
  here.u = 0.0;
  EXPECT_EQ(service.set_zero_here(here).error().code, ErrorCode::Usage);
}

TEST(ReferenceService, AConfiguredZeroIsValidForTheFirstSetUpOnly) {
  const auto config = reference_config_of(kCard.substr(0, kCard.find("axes")) + kHere +
                                          kCard.substr(kCard.find("axes")));
  ReferenceService service{config, nullptr};
  Batch batch = counts(HostTime{1s}, 400, true);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0);
  EXPECT_EQ(batch.axes[0].position[2], -250e-9 * 400.0);

  // The bus failed for a moment: the counters begin at 0 where the machine stands now.
  batch = counts(HostTime{2s}, 0, true);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b111);
  batch = counts(HostTime{3s}, 0);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b111);
}

TEST(ReferenceService, ItIsDecidedForEachAxis) {
  const auto config = reference_config_of(kCard.substr(0, kCard.find("axes")) + kHere +
                                          kCard.substr(kCard.find("axes")) + reference(""));
  ReferenceService service{config, nullptr};
  Batch batch = counts(HostTime{1s}, 0, true);
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b100);
  EXPECT_EQ(service.set_zero_here(z_at(HostTime{1s})).error().code, ErrorCode::Usage);
}

TEST(Zero, IsTheSameFromTheRecording) {
  const FoundZero zero{.axis = 2,
                       .reading_at_zero = 0.1 + 1e-17,
                       .u = 1e-7,
                       .from = HostTime{123456789ns},
                       .stated = true};
  const auto back = zero_from_attachment(to_attachment(zero));
  ASSERT_TRUE(back) << back.error().text;
  EXPECT_EQ(back->axis, zero.axis);
  EXPECT_EQ(back->reading_at_zero, zero.reading_at_zero);
  EXPECT_EQ(back->u, zero.u);
  EXPECT_EQ(back->from, zero.from);
  EXPECT_EQ(back->stated, zero.stated);
}

TEST(Zero, AppliesToSamplesLaterThanItWasFound) {
  AxisZeros zero{reference_config_of(kCard + reference(""))};
  zero.found({.axis = 2, .reading_at_zero = 0.3, .from = HostTime{10s}});
  Batch batch;

  for (const auto t : {9s, 10s, 11s}) {
    auto& sample = batch.axes.emplace_back();
    sample.head.time = HostTime{t};
    sample.axis_count = 3;
    sample.count[2] = 4;
  }

  zero.apply(batch);
  EXPECT_EQ(batch.axes[1].missing_mask & 0b100, 0b100);
  EXPECT_EQ(batch.axes[2].missing_mask & 0b100, 0);
  EXPECT_DOUBLE_EQ(batch.axes[2].position[2], 0.3 - 1e-6);
}

}  // namespace
}  // namespace abbe::daemon
