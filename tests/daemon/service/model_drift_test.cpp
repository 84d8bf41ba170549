/// Drift of the active model: the store's record of it, the state, the update of the active model,
/// and the whole way through the calibration service.

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <atomic>
#include <optional>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/methods/drift.hpp"
#include "abbe/service/calibration_service.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"
#include "synthetic_otf_run.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using v1::ModelStatus;

constexpr HostTime kDriftStart{1000s};

StoreActor drift_actor(std::string why) {
  return {"anna", std::move(why), protocol::UtcTime{1'715'934'600s}};
}

class DriftRecord : public ::testing::Test {
 protected:
  DriftRecord() {
    id_ = store_.add(test::synthetic_document(1), true, {}, drift_actor("first")).value();
    EXPECT_TRUE(store_.activate(id_, drift_actor("first")));
  }

  TemporaryFolder folder_;
  ModelStore store_ = ModelStore::open(folder_.path() / "models").value();
  std::string id_;
};

TEST_F(DriftRecord, IsKeptUntilTheNextActivation) {
  EXPECT_EQ(store_.drift().value(), "");
  ASSERT_TRUE(store_.add_drift(id_, drift_actor("EXX by 4 um")));
  EXPECT_EQ(ModelStore::open(folder_.path() / "models")->drift().value(), "EXX by 4 um");
  EXPECT_EQ(store_.active_id().value(), id_);
  ASSERT_TRUE(store_.activate(id_, drift_actor("checked")));
  EXPECT_EQ(store_.drift().value(), "");
  EXPECT_EQ(store_.history()->at(2).action, StoreAction::Drifted);
}

TEST_F(DriftRecord, IsNotMadeTwice) {
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(store_.add_drift(id_, drift_actor("EXX by 4 um")));
  EXPECT_EQ(store_.history()->size(), 3u);
}

TEST_F(DriftRecord, IsOfTheActiveModelOnly) {
  ASSERT_TRUE(store_.add_drift("0123456789abcdef", drift_actor("EXX by 4 um")));
  EXPECT_EQ(store_.drift().value(), "");
}

calib::Verdict accepted_verdict() {
  calib::Verdict verdict;
  verdict.held_out = {.no_compensation = 50.0, .candidate = 1.0, .observations = 100};
  verdict.accepted = true;
  return verdict;
}

/// `by`: added to the first squareness error.
calib::VolumetricModel changed_model(double by_rad) {
  auto description = test::synthetic_model(1).description();
  for (auto& p : description.parameters) p.value += p.name == "EC0Y" ? by_rad : 0.0;
  return calib::VolumetricModel::from_description(std::move(description)).value();
}

TEST(DriftFindings, NameTheTableThatChangedWithItsUncertainty) {
  const auto finding =
      find_drift(changed_model(20e-6), accepted_verdict(), test::synthetic_model(1), {});
  ASSERT_TRUE(finding.test && finding.test->drifted);
  EXPECT_THAT(finding.test->drifted_tables(), ElementsAre("EC0Y"));
  EXPECT_THAT(finding.state(), HasSubstr("EC0Y by 20 urad (u "));
  EXPECT_THAT(finding.notes, ElementsAre(HasSubstr("EC0Y changed by 20 urad")));
}

TEST(DriftFindings, AreNoneForAnUnchangedMachine) {
  const auto finding =
      find_drift(test::synthetic_model(1), accepted_verdict(), test::synthetic_model(1), {});
  EXPECT_EQ(finding.state(), "");
  EXPECT_THAT(finding.notes, IsEmpty());
}

TEST(DriftFindings, AModelWithOtherNodesIsANote) {
  const auto finding =
      find_drift(test::synthetic_model(1, 2.0), accepted_verdict(), test::synthetic_model(1), {});
  EXPECT_FALSE(finding.test);
  EXPECT_THAT(finding.notes, ElementsAre(HasSubstr("not tested for drift")));
}

TEST(DriftFindings, ARunWithAFaultIsNoEvidence) {
  auto verdict = accepted_verdict();
  verdict.refuse("moved", "the tracker moved");
  EXPECT_FALSE(find_drift(changed_model(20e-6), verdict, test::synthetic_model(1), {}).test);
}

TEST(DriftFindings, TheUpdateNamesWhatItRenewed) {
  const auto active = test::synthetic_model(1), run = changed_model(20e-6);
  const auto finding = find_drift(run, accepted_verdict(), active, {});
  const CalibrationRun otf = OtfRun{};
  const auto options = update_options(otf, finding, 2.0, {.continuous = true});
  EXPECT_THAT(options.renewed, ElementsAre("EC0Y"));
  const auto updated =
      updated_model({run}, accepted_verdict(), {active}, *finding.test, options, GateConfig{});
  ASSERT_TRUE(updated) << updated.error().text;
  EXPECT_THAT(updated->verdict.notes.back(), HasSubstr("2 days old"));
  EXPECT_THAT(updated->verdict.notes.back(), HasSubstr("EC0Y of the run alone"));
}

TEST(OffsetInCommon, IsThatOfAYoungModelFromTheSamePlace) {
  const std::optional run{calib::TrackerPlace{"door", {.value_m = 1e-6}}},
      same{calib::TrackerPlace{"door", {.value_m = 2e-6}}},
      other{calib::TrackerPlace{"window", {.value_m = 3e-6}}};
  const DriftConfig config{.place_days = 30.0};
  const auto common = offset_in_common(run, same, 29.0, config);
  ASSERT_TRUE(common.of_active);
  EXPECT_EQ(common.of_active->value_m, 2e-6);
  EXPECT_EQ(common.note, "");

  const auto note = [&](const std::optional<calib::TrackerPlace>& active, double days) {
    const auto found = offset_in_common(run, active, days, config);
    EXPECT_FALSE(found.of_active);
    return found.note;
  };
  EXPECT_THAT(note(same, 31.0), HasSubstr("31 days old, more than [drift] place_days = 30"));
  EXPECT_THAT(note(other, 1.0), HasSubstr("the active model is of the place \"window\""));
  EXPECT_THAT(note({}, 1.0), HasSubstr("names no place of the tracker"));
  EXPECT_THAT(note(same, -1.0), HasSubstr("the clock was set back"));
  EXPECT_FALSE(offset_in_common({}, same, 1.0, config).of_active);
  EXPECT_THAT(offset_in_common({}, same, 1.0, config).note,
              HasSubstr("the run names no place of the tracker"));
  EXPECT_EQ(offset_in_common({}, {}, 1.0, config).note, "");
}

/// Two runs with one offset: that of the update is known better than that of either.
TEST(OffsetInCommon, IsKeptByTheUpdate) {
  const auto model = test::synthetic_model(1);
  const calib::OffsetInModel offset{.dU_dd = Eigen::VectorXd::Zero(model.U().size()),
                                    .value_m = 1e-6,
                                    .u_m = 2e-6,
                                    .u_prior_m = 6e-6};
  const auto finding = find_drift(model, accepted_verdict(), model, {});
  const auto updated = updated_model({model, offset}, accepted_verdict(), {model, offset},
                                     *finding.test, {}, GateConfig{});
  ASSERT_TRUE(updated) << updated.error().text;
  ASSERT_TRUE(updated->model.range_offset);
  EXPECT_LT(updated->model.range_offset->u_m, 1.5e-6);

  auto moved = offset;
  moved.value_m = -20e-6;
  const auto refused = updated_model({model, moved}, accepted_verdict(), {model, offset},
                                     *finding.test, {}, GateConfig{});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("give the place a new name"));
}

TEST(DriftConfiguration, NamesThePlaceOfTheTracker) {
  const auto machine = [](const std::string& keys) {
    return parse_config(test::synthetic_machine_toml() + "place = \"door\"\n" + keys,
                        "machine.toml");
  };
  const auto config = machine("[drift]\nplace_days = 7\n");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->machine.tracker_place, "door");
  EXPECT_EQ(config->drift.place_days, 7.0);
  EXPECT_EQ(parse_config(test::synthetic_machine_toml(), "machine.toml")->drift.place_days, 30.0);

  const auto no_offset = machine("u_range_offset_um = 0\n");
  ASSERT_FALSE(no_offset);
  EXPECT_THAT(no_offset.error().details, ElementsAre(HasSubstr("needs u_range_offset_um > 0")));
  const auto nests = machine(
      "nest = [{ name = \"A\", position_mm = [1500, -900, 200] }, { name = \"B\", "
      "position_mm = [1800, 950, 150] }]\n");
  ASSERT_FALSE(nests);
  EXPECT_THAT(nests.error().details, ElementsAre(HasSubstr("needs no [[tracker.nest]]")));
}

TEST(DriftConfiguration, HasNoiseForSingleTables) {
  const auto config = parse_config(
      test::synthetic_machine_toml() + "[drift]\nnoise_um = 0.25\n[drift.tables]\nEXX = 2\n",
      "machine.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_DOUBLE_EQ(config->drift.length_m_per_root_day, 0.25e-6);
  EXPECT_DOUBLE_EQ(config->drift.of_tables.at("EXX"), 2e-6);
}

TEST(DriftConfiguration, NamesATableThatDoesNotExist) {
  const auto config =
      parse_config(test::synthetic_machine_toml() + "[drift.tables]\nEQX = 2\n", "machine.toml");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().details,
              ElementsAre(HasSubstr("drift.tables.EQX: is no error table")));
}

TEST(DriftCommand, PrintsTheTableThatChangedAndExitsWith5) {
  TemporaryFolder folder;
  auto document = test::synthetic_document(1);
  test::write_text(folder.path() / "a.json", to_json(document));
  document.model = changed_model(20e-6);
  test::write_text(folder.path() / "b.json", to_json(document));

  const auto same = test::run_abbe(folder.path(), "model drift a.json a.json");
  EXPECT_EQ(same.exit, 0) << same.err;
  EXPECT_THAT(same.out, HasSubstr("no table differs by more than its uncertainty"));
  const auto changed = test::run_abbe(folder.path(), "model drift a.json b.json");
  EXPECT_EQ(changed.exit, 5);
  EXPECT_THAT(changed.out, HasSubstr("B differs from A: EC0Y by 20 urad"));
  const auto printed = test::run_abbe(folder.path(), "model drift a.json b.json --json");
  EXPECT_THAT(printed.out, HasSubstr("\"drifted\": true"));
}

/// The small machine of synthetic_otf_run.hpp; a run takes the samples of a noise-free tracker.
class DriftingMachine : public ::testing::Test {
 protected:
  void configure(const std::string& drift) {
    config_ = parse_config(test::synthetic_machine_toml() + drift, "machine.toml").value();
    restart();
  }
  void restart() {
    service_.reset();
    const WallClock clock{[this] { return clocks(); }};
    authority_.emplace(ModelAuthority::open(folder_.path() / "models", config_, clock, now_));
    service_.emplace(config_, *authority_, nullptr, clock);
  }
  /// The clocks of the computer, of which the host clock does not see `set_` and `suspended_`.
  [[nodiscard]] ClockReading clocks() const {
    const auto running = seen_.load().time_since_epoch();
    return {.utc = kFirstDay + running + suspended_.load() + set_.load(),
            .since_boot = running + suspended_.load(),
            .running = running};
  }
  [[nodiscard]] protocol::UtcTime utc_now() const { return protocol::UtcTime{clocks().utc}; }
  [[nodiscard]] ModelDocument stored_model() const {
    return store().load(model().model->id).value();
  }
  /// Drives the path and follows the session to its end. Returns the states of the active model
  /// that were seen, without repetition.
  std::vector<ModelStatus> calibrate() {
    EXPECT_TRUE(service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_));
    drive();
    std::vector<ModelStatus> seen;
    for (SessionState s = service_->status().state;; s = service_->status().state) {
      if (seen.empty() || seen.back() != status()) seen.push_back(status());
      if (s == SessionState::Active || s == SessionState::Refused) return seen;
      std::this_thread::yield();
      seen_ = now_ += 10ms;
      (void)service_->cycle({}, now_);
    }
  }
  [[nodiscard]] ActiveModelState model() const { return authority_->model_state(now_, now_, 1s); }
  [[nodiscard]] ModelStatus status() const { return model().status; }
  [[nodiscard]] ModelStore store() const { return ModelStore{folder_.path() / "models"}; }

  static constexpr std::chrono::nanoseconds kFirstDay = std::chrono::hours{24 * 365 * 55};
  HostTime now_ = kDriftStart;
  std::atomic<HostTime> seen_{kDriftStart};  // by the identification, another thread
  std::atomic<std::chrono::nanoseconds> set_{}, suspended_{};
  TemporaryFolder folder_;
  Config config_;
  sim::TruthMachine truth_ = test::synthetic_truth();
  std::optional<ModelAuthority> authority_;
  std::optional<CalibrationService> service_;

 private:
  void drive() {
    sim::PathPlan plan{.dwell_s = 0.2};
    for (const auto& q : test::synthetic_path_m()) plan.vertices.push_back({q, 0.2});
    const auto motion = sim::PathMotion::plan(plan).value();
    const Eigen::Matrix3d R = Eigen::AngleAxisd(-1.1, Eigen::Vector3d::UnitZ()).matrix();
    const HostTime from = now_;
    for (double t_s = -1.0; t_s < motion.duration_s() + 2.0; t_s += 1.0 / test::kPointRate_Hz) {
      const auto q = motion.at(t_s).q_m;
      const Eigen::Vector3d seen =
          R * (sim::position_m(truth_, q) - Eigen::Vector3d(-0.9, -0.7, -0.3));
      now_ = from + std::chrono::duration_cast<std::chrono::nanoseconds>(
                        std::chrono::duration<double>(t_s + 1.0));
      show({q[0], q[1], q[2]}, {seen[0], seen[1], seen[2]});
    }
  }
  void show(const AxisPosition& q, const AxisPosition& p_tracker_m) {
    protocol::Snapshot s;
    s.head.time = now_;
    s.axis_count = 3;
    for (std::size_t a = 0; a < 3; ++a) s.position[a] = q[a];
    s.has_tracker_point = true;
    s.tracker_point.device_time = protocol::DeviceTime{now_.time_since_epoch()};
    s.tracker_point.p_tracker_m = p_tracker_m;
    seen_ = now_;
    (void)service_->cycle({&s, 1}, now_);
  }
};

TEST_F(DriftingMachine, RaisesDriftBeforeTheNewModelIsActive) {
  configure("");
  EXPECT_EQ(calibrate().back(), ModelStatus::MODEL_ACTIVE) << service_->status().reason;
  const std::string first = model().model->id;
  truth_.squareness.C0Y_rad += 60e-6;
  const auto seen = calibrate();
  EXPECT_THAT(seen, ElementsAre(ModelStatus::MODEL_ACTIVE, ModelStatus::MODEL_DRIFT,
                                ModelStatus::MODEL_ACTIVE));
  EXPECT_NE(model().model->id, first);
  EXPECT_THAT(service_->status().reason,
              HasSubstr("drift since the active model: EC0Y changed by"));
  const auto kept = store().load(model().model->id).value();
  EXPECT_THAT(kept.verdict->notes,
              ::testing::Contains(HasSubstr("drift since the active model: EC0Y changed by")));
}

TEST_F(DriftingMachine, AModelKeepsWhenItWasMeasured) {
  configure("");
  const auto before = utc_now();
  (void)calibrate();
  const auto document = stored_model();
  const auto [first, last] = document.run->conditions->measured.value();
  EXPECT_GT(first, before);
  EXPECT_LT(last, document.created);
  // The standstills before and after the path (0.4 s each) have no residuals.
  EXPECT_NEAR(std::chrono::duration<double>(last - first).count(),
              *document.run->conditions->duration_s, 2.0);
}

TEST_F(DriftingMachine, DatesAreThoseOfAWallClockThatWasSetAfterTheStart) {
  configure("");
  for (const auto set :
       {std::chrono::nanoseconds{24h * 200}, std::chrono::nanoseconds{-24h * 200}}) {
    restart();  // the change is counted from the start
    const auto before = utc_now() + set;
    set_ = set_.load() + set;
    (void)calibrate();
    const auto document = stored_model();
    EXPECT_GE(document.created, before);
    EXPECT_LE(document.created, utc_now());
    const auto [first, last] = document.run->conditions->measured.value();
    EXPECT_GT(first, before);
    EXPECT_LT(last, document.created);
    const auto events = store().history().value();
    for (const StoreEvent& event : events) {
      if (event.id == model().model->id) EXPECT_EQ(event.actor.when, document.created);
    }
    EXPECT_THAT(
        document.verdict->notes,
        ::testing::Contains(HasSubstr(set > 0ns ? "set forward by 200 d 0 h since abbed"
                                                : "set backward by 200 d 0 h since abbed")));
    EXPECT_THAT(service_->status().reason, HasSubstr("the wall clock was set"));
    truth_.squareness.C0Y_rad += 60e-6;  // another model, so that the store keeps both
  }
}

TEST_F(DriftingMachine, ASuspendedComputerIsInTheVerdict) {
  configure("");
  suspended_ = 3h;
  const auto resumed = utc_now();
  (void)calibrate();
  const auto document = stored_model();
  EXPECT_LE(document.created, utc_now());
  EXPECT_GT(document.created, resumed);
  EXPECT_THAT(document.verdict->notes,
              ::testing::Contains(HasSubstr("suspended for 3 h 0 min since abbed started")));
}

TEST_F(DriftingMachine, AClockThatRunsOnLeavesNoNote) {
  configure("");
  set_ = 1s;  // a leap second
  (void)calibrate();
  EXPECT_THAT(stored_model().verdict->notes,
              ::testing::Not(::testing::Contains(HasSubstr("since abbed started"))));
}

TEST_F(DriftingMachine, TheModelHashDoesNotDependOnTheWallClock) {
  configure("");
  (void)calibrate();
  const auto before = model_hash(stored_model());
  set_ = 24h * 200;
  seen_ = now_ = kDriftStart;  // the same samples on another day
  restart();
  (void)calibrate();
  EXPECT_EQ(model_hash(stored_model()), before);
}

TEST_F(DriftingMachine, AnUnchangedMachineRaisesNone) {
  configure("");
  (void)calibrate();
  const auto seen = calibrate();
  EXPECT_THAT(seen, ElementsAre(ModelStatus::MODEL_ACTIVE));
  EXPECT_EQ(store().drift().value(), "");
}

TEST_F(DriftingMachine, ADriftIsHeldUntilAModelIsActivated) {
  configure("[drift]\nhold = true\n");
  (void)calibrate();
  const std::string first = model().model->id;
  truth_.squareness.C0Y_rad += 60e-6;
  EXPECT_EQ(calibrate().back(), ModelStatus::MODEL_DRIFT);
  EXPECT_EQ(model().model->id, first);
  EXPECT_THAT(model().reason, HasSubstr("EC0Y by 60 urad"));

  restart();
  EXPECT_EQ(status(), ModelStatus::MODEL_DRIFT);
  ASSERT_TRUE(store().activate(first, drift_actor("checked")));
  while (authority_->follow_store(now_) == ModelAuthority::Following::Reading)
    std::this_thread::yield();
  EXPECT_EQ(status(), ModelStatus::MODEL_ACTIVE);
}

TEST_F(DriftingMachine, ARunUpdatesTheActiveModelAndNamesBothParents) {
  configure("[drift]\ncontinuous = true\n");
  (void)calibrate();
  const std::string first = model().model->id;
  (void)calibrate();
  ASSERT_EQ(status(), ModelStatus::MODEL_ACTIVE) << service_->status().reason;
  const std::string second = model().model->id;
  EXPECT_NE(second, first);
  const auto document = store().load(second).value();
  EXPECT_EQ(document.estimator, "simultaneous, update");
  const auto& previous = document.inputs.back();
  EXPECT_EQ(previous.name, "previous model " + first);
  EXPECT_EQ(previous.sha256, model_hash(store().load(first).value()));
  EXPECT_THAT(document.inputs.at(document.inputs.size() - 2).name, HasSubstr("run, model "));
  // The residuals are those of the model of the run, which is stored beside the update.
  const std::string of_run = document.run->of_model;
  EXPECT_EQ(document.inputs.at(document.inputs.size() - 2).name, "run, model " + of_run);
  EXPECT_EQ(store().load(of_run)->statistics, document.statistics);
  EXPECT_FALSE(store().load(of_run)->run->held_out_cells.empty());
  EXPECT_TRUE(document.run->held_out_cells.empty());
  EXPECT_THAT(document.verdict->notes, ::testing::Contains(HasSubstr("was updated with the run")));
  EXPECT_LT(document.model.parameters().back().u, store().load(first)->model.parameters().back().u);
}

/// The model of the last run from the place, also after a restart.
TEST_F(DriftingMachine, RunsFromOnePlaceShareTheOffsetOfTheRanges) {
  configure("place = \"door\"\n[drift]\ncontinuous = true\n");
  std::vector<double> u_m;
  for (int run = 0; run < 3; ++run) {
    restart();
    (void)calibrate();
    ASSERT_EQ(status(), ModelStatus::MODEL_ACTIVE) << service_->status().reason;
    const auto place = store().load(model().model->id)->tracker_place;
    ASSERT_TRUE(place);
    EXPECT_EQ(place->name, "door");
    u_m.push_back(place->range_offset.u_m);
  }
  EXPECT_LT(u_m[1], u_m[0]);
  EXPECT_LT(u_m[2], u_m[1]);

  configure("place = \"window\"\n[drift]\ncontinuous = true\n");
  restart();
  (void)calibrate();
  const auto document = store().load(model().model->id).value();
  EXPECT_EQ(document.tracker_place->name, "window");
  EXPECT_THAT(document.verdict->notes,
              ::testing::Contains(HasSubstr("the active model is of the place \"door\"")));
}

}  // namespace
}  // namespace abbe::daemon
