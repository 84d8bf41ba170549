// Which models are for the present configuration, what is named of the others, and who may accept a
// model of an earlier version.
#include "abbe/model/configuration_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "abbe/service/model_authority.hpp"
#include "abbe_command.hpp"
#include "config_fixture.hpp"
#include "synthetic_model.hpp"
#include "synthetic_otf_recording.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Kind = ConfigurationFit::Kind;

const std::string kEncoders = kMachine + kCanBus + kNodes;
constexpr protocol::HostTime kFitNow{std::chrono::seconds{1000}};

Config fit_config(const std::string& text) {
  return parse_config(text, "abbed.toml").value();
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  return text.replace(text.find(what), what.size(), by);
}

ModelDocument document_for(const Config& config) {
  auto document = test::synthetic_document(1);
  document.machine_hash = machine_hash(config);
  document.configuration = config.meaning;
  return document;
}

/// As an earlier version stored it.
ModelDocument former_document(const Config& config) {
  auto document = test::synthetic_document(1);
  document.machine_hash = former_machine_hash(config);
  return document;
}

ConfigurationFit fit_with(const ModelDocument& document, const std::string& text) {
  return fit_of(document, present_configuration(fit_config(text)));
}

TEST(ConfigurationFit, OfAnEarlierVersionIsFitWhereItWasAccepted) {
  const auto config = fit_config(kEncoders);
  const auto present = present_configuration(config);
  const auto document = former_document(config);
  EXPECT_EQ(unfit_for(document, present, present.hash), "");
  EXPECT_NE(unfit_for(document, present, "of another"), "");
}

TEST(ConfigurationFit, OfAnUnchangedConfigurationIsTheSame) {
  const auto fit = fit_with(document_for(fit_config(kEncoders)), kEncoders);
  EXPECT_EQ(fit.kind, Kind::Same);
  EXPECT_EQ(fit.sentence, "");
  EXPECT_EQ(fit_with(document_for(fit_config(kEncoders)),
                     replaced(kEncoders, "axis = \"X\"", "tpdo = 1, axis = \"X\""))
                .kind,
            Kind::Same)
      << "a default that is written out";
}

TEST(ConfigurationFit, NamesWhatDiffers) {
  const auto document = document_for(fit_config(kEncoders));
  const auto node = fit_with(document, replaced(kEncoders, "node = 2", "node = 2, tpdo = 2"));
  EXPECT_EQ(node.kind, Kind::Other);
  EXPECT_THAT(node.sentence, HasSubstr("[encoder] Y tpdo was 1, is 2"));
  const auto simulated = fit_with(document, kEncoders + "[daemon]\nsimulated = true\n");
  EXPECT_THAT(simulated.sentence, HasSubstr("[daemon] simulated was false, is true"));
}

TEST(ConfigurationFit, NamesADeviceThatWasReplacedOnce) {
  const auto fit = fit_with(document_for(fit_config(kEncoders)), kMachine + R"([counter_card]
transport = "usb"
axes = [
  { axis = "X", channel = 0, step_nm = 1 },
  { axis = "Y", channel = 1, step_nm = 1 },
  { axis = "Z", channel = 2, step_nm = 1 },
]
)");
  EXPECT_EQ(fit.kind, Kind::Other);
  EXPECT_THAT(fit.sentence, AllOf(HasSubstr("[encoder] was configured, is not"),
                                  HasSubstr("[counter_card] was not configured, is now"),
                                  Not(HasSubstr("channel"))));
}

TEST(ConfigurationFit, ATrackerThatIsTakenAwayChangesNothing) {
  const std::string tracker = "[tracker]\nhost = \"10.0.0.1\"\nreflector = \"A\"\n";
  const auto document = document_for(fit_config(kEncoders + tracker));
  EXPECT_EQ(fit_with(document, kEncoders).kind, Kind::Same);
  const auto present = present_configuration(fit_config(kEncoders + replaced(tracker, "A", "B")));
  EXPECT_EQ(fit_of(document, present).kind, Kind::Same);
  EXPECT_EQ(changed_measurements(document, present), "[tracker] reflector was A, is B");
}

TEST(ConfigurationFit, OfAnEarlierVersionNamesWhatItsHashDoesNotContain) {
  const auto fit = fit_with(former_document(fit_config(kEncoders)), kEncoders);
  EXPECT_EQ(fit.kind, Kind::OlderHash);
  EXPECT_THAT(
      fit.sentence,
      AllOf(HasSubstr("[daemon] simulated, speed"), HasSubstr("[encoder] sampling_delay_us, tpdo"),
            HasSubstr("--accept-older-hash"), Not(HasSubstr("step_nm")), Not(HasSubstr("chain"))));
  const auto other =
      fit_with(former_document(fit_config(kEncoders)), replaced(kEncoders, "node = 2", "node = 4"));
  EXPECT_EQ(other.kind, Kind::Other);
}

TEST(ConfigurationFit, AKeyOfALaterVersionMakesTheHashAnOlderOne) {
  auto document = document_for(fit_config(kEncoders));
  std::erase_if(document.configuration->readings,
                [](const MeaningEntry& entry) { return entry.key.ends_with(".tpdo"); });
  document.machine_hash = hash_of(document.configuration->readings);
  const auto fit = fit_with(document, kEncoders);
  EXPECT_EQ(fit.kind, Kind::OlderHash);
  EXPECT_THAT(fit.sentence, HasSubstr("does not contain [encoder] tpdo:"));
}

TEST(ModelConfiguration, IsWrittenAndReadAgain) {
  const auto document = document_for(fit_config(kEncoders + "[daemon]\nsimulated = true\n"));
  const auto text = to_json(document);
  EXPECT_THAT(text, HasSubstr("\"simulated\": true"));
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << ::testing::PrintToString(read.error().details);
  EXPECT_EQ(read->configuration, document.configuration);
  EXPECT_EQ(made_on_simulated_devices(*read), true);
}

TEST(ModelConfiguration, ThatWasEditedIsRefused) {
  const auto text = to_json(document_for(fit_config(kEncoders + "[daemon]\nsimulated = true\n")));
  const auto stated =
      parse_model(replaced(text, "\"simulated\": true", "\"simulated\": false"), "m");
  ASSERT_FALSE(stated);
  EXPECT_THAT(stated.error().details, ::testing::Contains(HasSubstr("simulated")));
  EXPECT_FALSE(parse_model(
      replaced(text, "\"daemon.simulated\": \"true\"", "\"daemon.simulated\": \"false\""), "m"));
}

TEST(ModelConfiguration, OfAnEarlierVersionIsNotKnown) {
  const auto read = parse_model(to_json(former_document(fit_config(kEncoders))), "model.json");
  ASSERT_TRUE(read) << ::testing::PrintToString(read.error().details);
  EXPECT_FALSE(read->configuration);
  EXPECT_EQ(made_on_simulated_devices(*read), std::nullopt);
}

class OlderModel : public ::testing::Test {
 protected:
  OlderModel() {
    write_config(kEncoders);
    auto store = ModelStore::open(models_).value();
    id_ = store.add(former_document(fit_config(kEncoders)), true, {}, {}).value();
    EXPECT_TRUE(store.activate(id_, {}));
  }

  void write_config(const std::string& text) const {
    test::write_text(folder_ / "abbed.toml", text + "[daemon]\ndata_dir = \".\"\n");
  }
  [[nodiscard]] ActiveModelState state() const {
    const auto config = load_config(folder_ / "abbed.toml").value();
    const auto authority = ModelAuthority::open(models_, config, {}, kFitNow);
    auto state = authority.model_state(kFitNow, kFitNow, std::chrono::seconds{1});
    state.model = nullptr;  // it ends with the authority
    state.publication = nullptr;
    return state;
  }
  [[nodiscard]] test::Ran activate(const std::string& options) const {
    return test::run_abbe(folder_, "model activate " + id_ + " -c abbed.toml " + options);
  }

  TemporaryFolder temporary_;
  const fs::path& folder_ = temporary_.path();
  fs::path models_ = folder_ / "models";
  std::string id_;
};

TEST_F(OlderModel, IsStaleUntilAPersonAcceptsItForThisConfiguration) {
  EXPECT_EQ(state().status, v1::ModelStatus::MODEL_STALE);
  EXPECT_THAT(state().reason, AllOf(HasSubstr("does not contain [daemon]"), HasSubstr(id_)));
  EXPECT_EQ(activate("").exit, 0);
  EXPECT_EQ(state().status, v1::ModelStatus::MODEL_STALE) << "activated, but not accepted";

  EXPECT_EQ(activate("--accept-older-hash").exit, 2) << "without a reason";
  const auto accepted = activate("--accept-older-hash --why checked");
  ASSERT_EQ(accepted.exit, 0) << accepted.err;
  EXPECT_EQ(state().status, v1::ModelStatus::MODEL_ACTIVE) << state().reason;
  EXPECT_THAT(state().reason, AllOf(HasSubstr("earlier version"), HasSubstr("checked")));
  const auto history = ModelStore::open(models_)->history().value();
  EXPECT_EQ(history.back().actor.why, "checked");
  EXPECT_EQ(history.back().accepted_configuration, machine_hash(fit_config(kEncoders)));

  write_config(replaced(kEncoders, "node = 2", "node = 2, tpdo = 2"));
  EXPECT_EQ(state().status, v1::ModelStatus::MODEL_STALE) << "accepted for the other configuration";
}

TEST_F(OlderModel, IsNotAcceptedWhereMoreDiffers) {
  write_config(replaced(kEncoders, "node = 2", "node = 4"));
  const auto ran = activate("--accept-older-hash --why checked");
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.err, HasSubstr("another machine configuration"));
  EXPECT_EQ(state().status, v1::ModelStatus::MODEL_STALE);
}

TEST_F(OlderModel, AModelOfThisVersionNeedsNoAcceptance) {
  auto store = ModelStore::open(models_).value();
  id_ = store.add(document_for(fit_config(kEncoders)), true, {}, {}).value();
  const auto ran = activate("--accept-older-hash --why checked");
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.err, HasSubstr("without --accept-older-hash"));
}

TEST(RecordedMeaning, SimulatedDevicesStaySimulatedWithAnotherMachineFile) {
  const TemporaryFolder temporary;
  const fs::path& folder = temporary.path();
  const auto recording = test::record_synthetic_run(folder, calib::otf::Mode::Standstill);
  const std::string real =
      replaced(test::synthetic_recorded_toml(), "simulated = true", "simulated = false");
  test::write_text(folder / "real.toml", real);
  const auto ran = test::run_abbe(
      folder, "identify otf --recording '" + recording.string() + "' --machine real.toml -o out");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto model = read_model(folder / "out" / "model.json").value();
  EXPECT_EQ(made_on_simulated_devices(model), true);
  EXPECT_THAT(fit_with(model, real).sentence, HasSubstr("[daemon] simulated was true, is false"));
  EXPECT_EQ(fit_with(model, test::synthetic_recorded_toml()).kind, Kind::Same);
}

}  // namespace
}  // namespace abbe::daemon
