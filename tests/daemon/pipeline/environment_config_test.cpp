#include <gmock/gmock.h>

#include <algorithm>
#include <string>

#include "abbe/config/config.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kMillWithEncoder = to_toml(config_tables::mill()) + std::string(R"([encoder]
transport = "udp"
peer_host = "10.0.0.8"
peer_port = 20000
nodes = [{axis = "Y", node = 2}, {axis = "X", node = 1}, {axis = "Z", node = 3}]
)");
const std::string kAir = R"([[environment]]
name = "air"
map = "comet-t7510"
host = "10.0.0.9"
serial_number = 20961234
)";
const std::string kScales = R"([[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
serial = "/dev/serial/by-id/rs485"
baud = 9600
parity = "none"
stop_bits = 2
unit = 3
inputs = ["scale_x", "", "part"]
)";

Config config_of(const std::string& text) {
  auto config = parse_config(kMillWithEncoder + text, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}
std::string fault_text_of(const std::string& text) {
  const auto config = parse_config(kMillWithEncoder + text, "abbed.toml");
  std::string all;
  if (!config)
    for (const auto& fault : config.error().details) all += fault + "\n";
  return all;
}

TEST(SensorConfiguration, HoldsAValueUntilTheNextReadingOfEveryDevice) {
  const std::string slow = kScales + "period_s = 90\n";
  EXPECT_EQ(config_of(slow).sensors.hold, std::chrono::seconds{135});
  EXPECT_EQ(config_of(kScales).sensors.hold, std::chrono::seconds{60});
  EXPECT_THAT(fault_text_of(slow + "[sensors]\nhold_s = 90\n"),
              HasSubstr("sensors.hold_s: 90 s is shorter than 1.5 times period_s = 90 of \"rtd\": "
                        "a value would not be held until the next reading; give at least 135, or "
                        "0"));
  for (const std::string fits : {"hold_s = 135\n", "hold_s = 0\n", "check = false\n"})
    EXPECT_EQ(fault_text_of(slow + "[sensors]\n" + fits), "") << fits;
}

TEST(SensorConfiguration, IsReadInSiUnits) {
  const auto sensors = config_of(kScales + kAir + R"([sensors]
hold_s = 30
correction_K_per_min = 0.6
[[sensors.limit]]
name = "scale_x"
expected_C = [15, 30]
max_rate_K_per_min = 3
twin = "part"
[[sensors.limit]]
name = "air_pressure"
expected_hPa = [900, 1050]
max_rate_hPa_per_min = 6
)")
                           .sensors;
  EXPECT_EQ(sensors.hold, std::chrono::seconds{30});
  EXPECT_DOUBLE_EQ(sensors.correction_K_per_s, 0.01);
  ASSERT_EQ(sensors.limits.size(), 2u);
  EXPECT_DOUBLE_EQ(*sensors.limits[0].lowest, 288.15);
  EXPECT_DOUBLE_EQ(*sensors.limits[0].most_per_s, 0.05);
  EXPECT_EQ(sensors.limits[0].twin, "part");
  EXPECT_DOUBLE_EQ(*sensors.limits[1].highest, 105'000.0);
  EXPECT_DOUBLE_EQ(*sensors.limits[1].most_per_s, 10.0);
}

TEST(SensorConfiguration, RefusesACorrectionThatFollowsNoSensor) {
  EXPECT_THAT(fault_text_of("[sensors]\ncorrection_K_per_min = 0.01\n"),
              ::testing::HasSubstr("sensors.correction_K_per_min: must be at least 0.1"));
}

TEST(SensorConfiguration, NamesEveryFault) {
  EXPECT_THAT(
      fault_text_of(kScales + R"([[sensors.limit]]
name = "scale_y"
[[sensors.limit]]
name = "scale_x"
expected_C = [30, 15]
twin = "scale_x"
max_rate_hPa_per_min = 3
[[sensors.limit]]
name = "scale_x"
)"),
      AllOf(HasSubstr("no [[environment]] measures it: check the name"),
            HasSubstr("the lowest and the highest"), HasSubstr("is the sensor itself"),
            HasSubstr("max_rate_hPa_per_min"), HasSubstr("has two [[sensors.limit]] tables")));
}

TEST(EnvironmentConfiguration, FindsDevicesByTheNameOfTheirMap) {
  const auto config = config_of(kAir + kScales);
  ASSERT_EQ(config.of<EnvironmentConfig>().size(), 2u);
  EXPECT_EQ(std::get<drivers::ModbusTcp>(config.of<EnvironmentConfig>()[0].address).host,
            "10.0.0.9");
  EXPECT_EQ(config.of<EnvironmentConfig>()[0].map.proving.front().expected, 20961234.0);
  const auto& line = std::get<drivers::ModbusSerial>(config.of<EnvironmentConfig>()[1].address);
  EXPECT_EQ(drivers::text_of(line), "/dev/serial/by-id/rs485 9600 8N2");
  EXPECT_THAT(config.temperatures, ElementsAre("scale_x", "part"));
  EXPECT_EQ(config.of<EnvironmentConfig>()[1].map.measured[1].place.address, 2);
}

TEST(EnvironmentConfiguration, NamesTheTemperatureThatIsOneTooMany) {
  std::string many = kScales;
  many.replace(many.find("[\"scale_x"), std::string::npos, R"(["a", "b", "c", "d", "e"]
[[environment]]
name = "parts"
map = "icpdas-zt2005-c8"
host = "10.0.0.7"
inputs = ["f", "g", "h", "i"]
[[thermal]]
axis = "X"
temperature = "i"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 1
u_temperature_K = 0.1
fixed_mm = 0
)");
  const auto faults = fault_text_of(many);
  EXPECT_THAT(faults, HasSubstr("temperature \"i\" is number 9, but"));
  EXPECT_EQ(std::ranges::count(faults, '\n'), 1) << faults;
}

TEST(EnvironmentConfiguration, TakesARegisterMapOfItsOwn) {
  const auto config = config_of(R"([[environment]]
name = "chiller"
map = "custom"
host = "10.0.0.9"
base_offset = -1
[[environment.measured]]
quantity = "temperature"
name = "coolant"
registers = "input"
address = 12
type = "float32"
word_order = "low_first"
quantity_unit = "C"
[[environment.measured]]
quantity = "air_pressure"
address = 20
type = "uint16"
scale = 0.1
quantity_unit = "hPa"
[[environment.proving]]
name = "device type"
address = 1
type = "uint16"
expected = 4711
)");
  ASSERT_EQ(config.of<EnvironmentConfig>().size(), 1u);
  const auto& map = config.of<EnvironmentConfig>()[0].map;
  EXPECT_EQ(map.base_offset, -1);
  EXPECT_EQ(map.measured[0].offset, 273.15);
  EXPECT_DOUBLE_EQ(map.measured[1].scale, 10.0);
  EXPECT_EQ(map.proving[0].expected, 4711.0);
}

TEST(EnvironmentConfiguration, RefusesInconsistentMaps) {
  const std::string custom = "[[environment]]\nname = \"a\"\nmap = \"custom\"\nhost = \"h\"\n";
  EXPECT_THAT(fault_text_of(custom), HasSubstr("no register is measured"));
  EXPECT_THAT(
      fault_text_of(custom + "[[environment.measured]]\nquantity = \"air_pressure\"\naddress = 1\n"
                             "type = \"int16\"\nquantity_unit = \"C\"\n"),
      HasSubstr("is not a unit of the quantity"));
  EXPECT_THAT(
      fault_text_of(custom + "[[environment.measured]]\nquantity = \"air_pressure\"\naddress = 1\n"
                             "type = \"int16\"\nquantity_unit = \"Pa\"\nscale = 0\n"),
      HasSubstr("must not be 0"));
}

TEST(EnvironmentConfiguration, RefusesAnUnknownMap) {
  EXPECT_THAT(fault_text_of("[[environment]]\nname = \"a\"\nmap = \"comet-t751\"\nhost = \"h\"\n"),
              HasSubstr("did you mean \"comet-t7510\"?"));
}

TEST(EnvironmentConfiguration, NeedsTheSerialNumberOfAComet) {
  EXPECT_THAT(fault_text_of("[[environment]]\nname = \"a\"\nmap = \"comet-t7510\"\nhost = \"h\"\n"),
              HasSubstr("needs the serial number"));
}

TEST(EnvironmentConfiguration, RefusesTwoDevicesThatMeasureTheSame) {
  EXPECT_THAT(
      fault_text_of(
          kAir + "[[environment]]\nname = \"b\"\nmap = \"vaisala-indigo520-hmp\"\nhost = \"h\"\n"),
      HasSubstr("air temperature is measured by two devices"));
}

TEST(EnvironmentConfiguration, RefusesADeviceWithoutAnAddressOrWithTwo) {
  EXPECT_THAT(fault_text_of("[[environment]]\nname = \"a\"\nmap = \"vaisala-indigo520-hmp\"\n"),
              HasSubstr("needs one of host"));
  EXPECT_THAT(
      fault_text_of(
          "[[environment]]\nname = \"a\"\nmap = \"vaisala-indigo520-hmp\"\nhost = \"h\"\nserial = "
          "\"/dev/ttyS0\"\n"),
      HasSubstr("needs one of host"));
}

TEST(EnvironmentConfiguration, DevicesOnOneSerialLineHaveTheSameSettings) {
  const auto second = [](const std::string& settings) {
    return "[[environment]]\nname = \"table\"\nmap = \"icpdas-zt2005-c8\"\nserial = "
           "\"/dev/serial/by-id/rs485\"\n" +
           settings + "unit = 4\ninputs = [\"table\"]\n";
  };

  EXPECT_THAT(fault_text_of(kScales + second("baud = 9600\nparity = \"none\"\nstop_bits = 2\n")),
              IsEmpty());
  for (const std::string settings :
       {"baud = 19200\nparity = \"none\"\nstop_bits = 2\n", "baud = 9600\n"})
    EXPECT_THAT(
        fault_text_of(kScales + second(settings)),
        AllOf(HasSubstr("\"table\""), HasSubstr("\"rtd\""), HasSubstr("9600 8N2"),
              HasSubstr("/dev/serial/by-id/rs485"), HasSubstr("same baud, parity and stop_bits")));
}

TEST(ThermalConfiguration, FindsTheAxisAmongTheEncodersAndTheTemperatureByName) {
  const auto config = config_of(kScales + R"([[thermal]]
axis = "Y"
temperature = "part"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 0.5
u_temperature_K = 0.2
fixed_mm = -200
)");
  const auto use = environment_use(config);
  ASSERT_EQ(use.thermal.size(), 1u);
  EXPECT_EQ(use.thermal[0].axis, 1u);
  EXPECT_EQ(use.thermal[0].config.temperature, 1);
  EXPECT_DOUBLE_EQ(use.thermal[0].config.alpha_per_K, 8e-6);
  EXPECT_DOUBLE_EQ(use.thermal[0].config.fixed_m, -0.2);
}

TEST(ThermalConfiguration, IsPartOfTheMachineHash) {
  const auto hash = [](const std::string& temperature, const std::string& alpha,
                       const std::string& u) {
    return machine_hash(config_of(kScales + "[[thermal]]\naxis = \"X\"\ntemperature = \"" +
                                  temperature + "\"\nalpha_um_per_m_K = " + alpha +
                                  "\nu_alpha_um_per_m_K = " + u +
                                  "\nu_temperature_K = 0.2\nfixed_mm = 0\n"));
  };
  const auto plain = hash("scale_x", "8", "0.5");
  EXPECT_NE(plain, machine_hash(config_of(kScales)));
  EXPECT_NE(plain, hash("part", "8", "0.5"));
  EXPECT_NE(plain, hash("scale_x", "9", "0.5"));
  EXPECT_EQ(plain, hash("scale_x", "8", "1"));  // how well it is known changes no reading
}

TEST(ThermalConfiguration, DecidesWhichSensorsGiveAReadingItsMeaning) {
  auto config = config_of(kScales);
  EXPECT_THAT(environment_meaning(config).readings, IsEmpty());
  config.thermal.push_back({.axis = "X", .temperature = 1});
  const auto readings = environment_meaning(config).readings;
  ASSERT_EQ(readings.size(), 1u);
  EXPECT_EQ(readings[0].key, "environment." + config.temperatures[1] + ".register");
}

TEST(ThermalConfiguration, RefusesATemperatureThatIsNotMeasured) {
  EXPECT_THAT(
      fault_text_of(kScales +
                    "[[thermal]]\naxis = \"X\"\ntemperature = \"scale_y\"\nalpha_um_per_m_K = 8\n"
                    "u_alpha_um_per_m_K = 1\nu_temperature_K = 1\nfixed_mm = 0\n"),
      HasSubstr("no [[environment]] measures it"));
}

TEST(AirConfiguration, TakesTheUncertaintyOfCo2) {
  EXPECT_DOUBLE_EQ(config_of("[air]\nu_co2_ppm = 50\n").air.u_co2_ppm, 50.0);
  EXPECT_THAT(fault_text_of("[air]\nu_co2_ppm = -1\n"), HasSubstr("air.u_co2_ppm"));
}

TEST(AirConfiguration, RefusesToCorrectForAirThatIsNotMeasured) {
  EXPECT_THAT(fault_text_of(
                  "[tracker]\nhost = \"t\"\nweather = \"none\"\n[air]\nassumed_index = 1.00027\n"),
              HasSubstr("an [[environment]] must measure"));
}

TEST(AirConfiguration, RefusesToCorrectDistancesTwice) {
  EXPECT_THAT(fault_text_of("[tracker]\nhost = \"t\"\n[air]\nassumed_index = 1.00027\n"),
              HasSubstr("the controller computes the index already"));
  EXPECT_THAT(fault_text_of(
                  "[tracker]\nhost = \"t\"\nweather = \"read\"\n[air]\nassumed_index = 1.00027\n"),
              IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
