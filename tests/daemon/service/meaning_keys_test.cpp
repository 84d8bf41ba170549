// Every key of the configuration, changed alone: a key that gives an axis reading its meaning
// changes the hash with which models are stored, and no other key does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <string>

#include "abbe/config/config.hpp"
#include "abbe/service/model_authority.hpp"
#include "configuration_changes.hpp"
#include "example_config.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using configuration_changes::Change;
using ::testing::AnyOf;
using ::testing::HasSubstr;

const std::string kAxesOfFive = R"([machine]
name = "mill 5"
chain = "[w C' B' X' b Y Z (C1) t]"
[axes.X]
min_mm = -300
max_mm = 300
[axes.Y]
min_mm = -250
max_mm = 250
[axes.Z]
min_mm = -400
max_mm = 0
[axes.B]
kind = "rotary"
min_rad = -1.5
max_rad = 1.5
reference_rad = 0.1
[target]
offset_mm = [20, -15, -120]
[model]
nodes_mm = { X = [-300, -100, 0, 300] }
)";

/// Axes whose mapping is stated, one of them rotary.
const std::string kExternalEncoders = kAxesOfFive + R"([tracker]
host = "192.168.0.1"
weather = "none"
vertical = "+Z"
position_mm = [2100, 900, -300]
search_radius_mm = 50
search_timeout_s = 30
nest = [{ name = "A", position_mm = [1500, -900, 200], radius_mm = 9 }]
[air]
assumed_index = 1.00027
equation = "ciddor"
wavelength_nm = 633
co2_ppm = 450
[encoder]
transport = "udp"
peer_host = "10.0.0.8"
peer_port = 1000
local_port = 1001
sync = "external"
sampling_delay_us = 5
axes_compensated = false
nodes = [
  { axis = "X", node = 1, step_nm = 10, tpdo = 1, position_byte = 0, offset_mm = 0.5 },
  { axis = "Y", node = 2, step_nm = 10, tpdo = 1, position_byte = 0 },
  { axis = "Z", node = 3, step_nm = 10, tpdo = 1, position_byte = 0, invert = false },
  { axis = "B", node = 4, step_nrad = 96000, tpdo = 1, position_byte = 0, offset_rad = 0.1, wrap_counts = 65536 },
]
[[environment]]
name = "air"
map = "comet-t7510"
host = "192.168.0.9"
serial_number = 20961234
)";

/// The readings are the positions of a measuring machine.
const std::string kMeasuringMachine = kAxesOfFive.substr(0, kAxesOfFive.find("[axes.B]")) + R"(
[cmm]
host = "10.0.0.9"
port = 1294
name = "cmm"
tool = "ruby 4"
home = false
probe = 1
u_position_um = 1.0
axes_compensated = false
command_timeout_s = 3
motion_timeout_s = 120
[daemon]
simulated = true
speed = 2
)";

const std::string kCounterCard = kAxesOfFive.substr(0, kAxesOfFive.find("[axes.B]")) + R"(
[counter_card]
transport = "usb"
axes = [
  { axis = "X", channel = 0, step_nm = 10, offset_mm = 1 },
  { axis = "Y", channel = 1, step_nm = 10 },
  { axis = "Z", channel = 2, step_nm = 10, invert = false },
]
)";

/// A tracker that sends lines of text, beside a counter card.
const std::string kLineTracker = kCounterCard + R"(
[tracker]
protocol = "lines"
transport = "tcp"
host = "192.168.0.1"
port = 7001
columns = ["time", "range", "azimuth", "elevation", "status"]
valid_status = ["0"]
length_unit = "m"
angle_unit = "deg"
time_unit = "ms"
separator = "semicolon"
decimal = "comma"
point_rate_hz = 250
weather = "compute"
)";

/// A control that prints the positions of its axes.
const std::string kAxisLines = kAxesOfFive + R"([axis_lines]
transport = "tcp"
host = "192.168.0.1"
port = 7002
columns = ["time", "X", "Y", "Z", "B", "status"]
valid_status = ["0"]
length_unit = "m"
angle_unit = "deg"
time_unit = "ms"
separator = "semicolon"
decimal = "comma"
sample_rate_hz = 250
axes_compensated = false
axes = [{ axis = "X", offset_mm = 0.5, invert = false }, { axis = "B", offset_rad = 0.1 }]
)";

const std::string kCoolantCorrectsY = R"(
[[thermal]]
axis = "Y"
temperature = "coolant"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 0.5
u_temperature_K = 0.2
fixed_mm = -300
)";

std::string all_defaults(const std::string& text) {
  return std::regex_replace(text, std::regex{"\n#([a-z_A-Z]+ = )"}, "\n$1");
}

/// A configuration whose keys are changed. `values` as in single_changes(), before those of
/// kValues.
struct Base {
  std::string name, text;
  std::map<std::string, std::string> values{};
  std::vector<std::string> meaning{};  ///< in addition to kMeaning
};

const std::vector<Base>& bases() {
  static const std::vector<Base> all{
      {"encoders, thermometers",
       all_defaults(example_config::with_modbus_and_cmm()) + kCoolantCorrectsY,
       // [[thermal]] excludes the one, real devices the other.
       {{"encoder.axes_compensated", ""}, {"daemon.speed", ""}}},
      {"counter cards, probe",
       std::regex_replace(example_config::with_counter_card_and_probe(),
                          std::regex{"clock_MHz = 10"}, "clock_MHz = 12"),
       {{"counter_card.axes.offset_mm", ""}}},  // [reference] gives it
      {"counter card alone", kCounterCard},
      {"tracker that sends lines",
       kLineTracker,
       {{"tracker.protocol", ""},
        {"tracker.host", R"("192.168.0.2")"},
        {"tracker.transport", R"("udp")"},
        {"tracker.columns", R"(["time", "range", "azimuth", "zenith", "status"])"},
        {"tracker.length_unit", R"("mm")"},
        {"tracker.angle_unit", R"("gon")"},
        {"tracker.time_unit", R"("us")"},
        {"tracker.separator", R"("tab")"},
        {"tracker.decimal", R"("point")"},
        {"tracker.weather", R"("none")"}}},
      {"axes as lines",
       kAxisLines,
       {{"axis_lines.host", R"("192.168.0.2")"},
        {"axis_lines.transport", R"("udp")"},
        {"axis_lines.columns", R"(["X", "time", "Y", "Z", "B", "status"])"},
        {"axis_lines.length_unit", R"("mm")"},
        {"axis_lines.angle_unit", R"("gon")"},
        {"axis_lines.time_unit", R"("us")"},
        {"axis_lines.separator", R"("tab")"},
        {"axis_lines.decimal", R"("point")"},
        {"axis_lines.axes.axis", ""},
        // The nodes end where the travel ends.
        {"axes.min_mm", ""},
        {"axes.max_mm", ""}},
       {"axis_lines.columns", "axis_lines.valid_status", "axis_lines.length_unit",
        "axis_lines.angle_unit", "axis_lines.time_unit", "axis_lines.axes_compensated",
        "axis_lines.axes.offset_mm", "axis_lines.axes.offset_rad", "axis_lines.axes.invert"}},
      {"encoders of the machine",
       kExternalEncoders,
       // The nodes end where the travel ends.
       {{"axes.min_mm", ""}, {"axes.max_mm", ""}, {"encoder.sync", ""}}},
      {"measuring machine",
       kMeasuringMachine,
       {{"daemon.simulated", ""}},
       {"cmm.tool", "cmm.axes_compensated"}}};
  return all;
}

/// Other values where one of the same type is not valid; "": not changed alone.
const std::map<std::string, std::string> kValues{
    {"machine.chain", R"("[w Y' b X Z (C1) t]")"},
    {"model.nodes_mm.X", "[-300, -200, 0, 300]"},
    {"model.node_spacing_mm", "25"},
    {"web.host_names", R"(["mill"])"},
    {"air.assumed_index", "1.0002"},
    {"models.keep_days", ""},  // needs keep_newest
    {"sensors.limit.name", ""},
    {"sensors.limit.twin", ""},
    {"axes.kind", ""},
    {"model.basis", R"("cubic")"},
    {"gate.accept", R"(["scale-change"])"},
    {"tracker.mode", ""},
    {"tracker.point_rate_hz", "250"},
    {"tracker.weather", R"("read")"},
    {"tracker.vertical", R"("-Z")"},
    {"encoder.transport", ""},
    {"encoder.sync", R"("kernel")"},
    {"encoder.nodes.axis", ""},
    {"encoder.nodes.node", "99"},
    {"counter_card.transport", ""},
    {"counter_card.axes.axis", ""},
    {"counter_card.axes.channel", "3"},
    {"counter_card.axes.step_nm", "5"},
    {"counter_card.clock_channel", "4"},
    {"counter_card.clock_source", R"("timer0")"},
    {"counter_card.latch_channel", "3"},
    {"counter_card.edge_channel", "4"},
    {"reference.axes.channel", "3"},
    {"reference.axes.signal_period_um", "40"},
    {"reference.axes.increment", "500"},
    {"reference.clock_source", R"("timer0")"},
    {"drift.forgetting", "0.5"},
    {"mtconnect.address", R"("127.0.0.2")"},
    {"web.address", R"("127.0.0.2")"},
    {"environment[1].stop_bits", "1"},
    {"counter_card.width_bits", "48"},
    {"counter_card.zero", R"("here")"},
    {"reference.transport", ""},
    {"reference.axes.axis", ""},
    {"air.equation", R"("edlen")"},
    {"daemon.realtime", R"("enforce")"},
    {"dds.supervise", R"("off")"},
    {"environment[0].map", ""},
    {"environment[1].map", ""},
    {"environment[2].map", ""},
    {"environment[1].parity", R"("even")"},
    {"thermal.axis", R"("Z")"},
    {"thermal.temperature", R"("part")"},
    {"environment[1].inputs", R"(["", "scale_x", "part"])"},
    {"environment[2].measured[0].quantity", ""},
    {"environment[2].measured[0].name", ""},
    {"environment[2].measured[0].registers", R"("holding")"},
    {"environment[2].measured[0].type", R"("int32")"},
    {"environment[2].measured[0].word_order", R"("high_first")"},
    {"environment[2].measured[0].quantity_unit", R"("K")"},
    {"environment[2].proving[0].type", R"("int16")"},
    {"otf.mode", R"("standstill")"},
    {"otf.estimator", R"("two-step")"},
    {"otf.backlash", R"("per-table")"},
    {"otf.smoothness", ""},
    {"evemu.estimator", R"("ols")"},
    {"evemu.folds", R"("ball")"},
    {"evemu.positions", "[1, 2, 3, 4, 5, 6, 7, 8]"},
};

/// The keys on which the meaning of an axis reading depends, as decided by people.
const std::set<std::string> kMeaning{
    "machine.name", "machine.chain", "axes.min_mm", "axes.max_mm", "axes.reference_mm",
    "axes.min_rad", "axes.max_rad", "axes.reference_rad", "target.offset_mm",
    "model.node_spacing_mm", "model.nodes_mm.X",
    // encoders
    "encoder.axes_compensated", "encoder.sampling_delay_us", "encoder.nodes.node",
    "encoder.nodes.step_nm", "encoder.nodes.step_nrad", "encoder.nodes.offset_mm",
    "encoder.nodes.offset_rad", "encoder.nodes.invert", "encoder.nodes.tpdo",
    "encoder.nodes.position_byte", "encoder.nodes.wrap_counts",
    // counter cards
    "counter_card.clock_channel", "counter_card.clock_source", "counter_card.clock_MHz",
    "counter_card.width_bits", "counter_card.zero", "counter_card.max_constant_delay_us",
    "counter_card.axes_compensated", "counter_card.axes.channel", "counter_card.axes.step_nm",
    "counter_card.axes.offset_mm", "counter_card.axes.invert", "reference.clock_channel",
    "reference.clock_source", "reference.clock_MHz", "reference.axes.channel",
    "reference.axes.signal_period_um", "reference.axes.increment", "reference.axes.length_mm",
    "reference.axes.zero_mark_mm", "reference.axes.reversed",
    // scales and their thermometers
    "thermal.axis", "thermal.temperature", "thermal.alpha_um_per_m_K", "thermal.fixed_mm",
    "environment[1].unit", "environment[1].inputs", "environment[1].base_offset",
    "environment[2].base_offset", "environment[2].measured[0].unit",
    "environment[2].measured[0].registers", "environment[2].measured[0].address",
    "environment[2].measured[0].type", "environment[2].measured[0].word_order",
    "environment[2].measured[0].quantity_unit", "environment[2].measured[0].scale",
    "environment[2].measured[0].offset", "environment[2].measured[0].unavailable",
    //
    "daemon.simulated", "daemon.speed"};

bool has_meaning(const Base& base, const std::string& key) {
  const auto general = configuration_changes::general(key);
  return kMeaning.contains(general) ||
         std::ranges::find(base.meaning, general) != base.meaning.end();
}

std::vector<Change> changes_of(const Base& base) {
  auto values = base.values;
  values.insert(kValues.begin(), kValues.end());
  return configuration_changes::single_changes(base.text, values);
}

Config config_of_text(const std::string& text) {
  const auto config = parse_config(text, "/etc/abbe/abbed.toml");
  EXPECT_TRUE(config) << ::testing::PrintToString(config.error().details);
  return config.value_or(Config{});
}

TEST(MeaningKeys, ChangeTheHashAndNoOtherKeyDoes) {
  for (const Base& base : bases()) {
    const std::string hash = machine_hash(config_of_text(base.text));
    for (const Change& change : changes_of(base)) {
      SCOPED_TRACE(base.name + ": " + change.key);
      EXPECT_EQ(machine_hash(config_of_text(change.text)) != hash, has_meaning(base, change.key));
    }
  }
}

/// A store with one active model, made with one configuration.
class StoreOfOneModel {
 public:
  explicit StoreOfOneModel(const Config& config) {
    fs::remove_all(folder_);
    auto document = test::synthetic_document(1);
    document.machine_hash = machine_hash(config);
    document.configuration = config.meaning;
    auto store = ModelStore::open(folder_).value();
    const auto id = store.add(document, true, {}, {}).value();
    EXPECT_TRUE(store.activate(id, {}));
  }
  ~StoreOfOneModel() { fs::remove_all(folder_); }
  StoreOfOneModel(const StoreOfOneModel&) = delete;
  StoreOfOneModel& operator=(const StoreOfOneModel&) = delete;

  [[nodiscard]] ActiveModelState state_with(const Config& config) const {
    constexpr protocol::HostTime kNow{std::chrono::seconds{1000}};
    const auto authority = ModelAuthority::open(folder_, config, {}, kNow);
    auto state = authority.model_state(kNow, kNow, std::chrono::seconds{1});
    state.model = nullptr;  // it ends with the authority
    state.publication = nullptr;
    return state;
  }

 private:
  fs::path folder_ = fs::path(::testing::TempDir()) / "meaning_keys_store";
};

TEST(MeaningKeys, AfterAChangeOfOneNoModelIsActiveAndTheStateNamesIt) {
  std::set<std::string> keys;
  std::size_t changes = 0;
  for (const Base& base : bases()) {
    const StoreOfOneModel store{config_of_text(base.text)};
    EXPECT_EQ(store.state_with(config_of_text(base.text)).status, v1::ModelStatus::MODEL_ACTIVE);
    for (const Change& change : changes_of(base)) {
      if (!has_meaning(base, change.key)) continue;
      SCOPED_TRACE(base.name + ": " + change.key);
      const auto state = store.state_with(config_of_text(change.text));
      EXPECT_NE(state.status, v1::ModelStatus::MODEL_ACTIVE);
      const std::string table = change.key.substr(0, change.key.find_first_of(".["));
      EXPECT_THAT(state.reason, AnyOf(HasSubstr("[" + table), HasSubstr("axes_compensated")));
      keys.insert(configuration_changes::general(change.key));
      ++changes;
    }
  }

  EXPECT_GE(keys.size(), 60u);
  std::cout << changes << " single changes of " << keys.size() << " keys: 0 ACTIVE\n";
}

}  // namespace
}  // namespace abbe::daemon
