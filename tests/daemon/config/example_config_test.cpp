/// The abbed.toml that is installed for people to start from.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "example_config.hpp"

namespace abbe::daemon {
namespace {

using example_config::example;
using example_config::uncommented;
using example_config::with_counter_card_and_probe;
using example_config::with_modbus_and_cmm;

std::string faults(const std::string& text) {
  const auto config = parse_config(text, "/etc/abbe/abbed.toml");
  std::string out;
  if (!config) out = config.error().text;
  for (std::size_t i = 0; !config && i < config.error().details.size(); ++i)
    out += "\n" + config.error().details[i];
  return out;
}

TEST(ExampleConfig, IsValid) {
  ASSERT_FALSE(example().empty());
  EXPECT_EQ(faults(example()), "");
}

TEST(ExampleConfig, ItsCommentedKeysAreValidToo) {
  ASSERT_NE(uncommented(), example());
  EXPECT_EQ(faults(uncommented()), "");
}

TEST(ExampleConfig, ItsExampleTablesAreValidToo) {
  ASSERT_EQ(faults(with_modbus_and_cmm()), "");
  const auto config = parse_config(with_modbus_and_cmm(), "/etc/abbe/abbed.toml").value();
  EXPECT_EQ(config.of<EnvironmentConfig>().size(), 3u);
  EXPECT_EQ(config.thermal.size(), 1u);
  EXPECT_EQ(config.sensors.limits.size(), 1u);
  EXPECT_TRUE(config.of<CmmConfig>());
}

TEST(ExampleConfig, ItsCounterCardShowsTheDefaults) {
  ASSERT_EQ(faults(with_counter_card_and_probe()), "");
  const auto config = parse_config(with_counter_card_and_probe(), "/etc/abbe/abbed.toml").value();

  ASSERT_TRUE(config.of<CounterCardConfig>() && config.of<ProbeConfig>() &&
              config.of<ReferenceConfig>());
  EXPECT_EQ(config.of<ReferenceConfig>()->marks.axes.size(), 3u);
  EXPECT_EQ(config.of<ReferenceConfig>()->marks.u_alignment, ReferenceMarks{}.u_alignment);
  EXPECT_EQ(config.of<ReferenceConfig>()->marks.tolerance_m, ReferenceMarks{}.tolerance_m);
  const CounterCardConfig plain;
  const auto& counter = *config.of<CounterCardConfig>();
  EXPECT_EQ(counter.card.name, plain.card.name);
  EXPECT_EQ(counter.card.wiring.clock_channel, plain.card.wiring.clock_channel);
  EXPECT_EQ(counter.card.wiring.clock_source, plain.card.wiring.clock_source);
  EXPECT_EQ(counter.card.wiring.clock_hz, plain.card.wiring.clock_hz);
  EXPECT_EQ(drivers::divisor_of(counter.card.wiring), drivers::divisor_of(plain.card.wiring));
  EXPECT_EQ(counter.card.wiring.width, plain.card.wiring.width);
  EXPECT_EQ(counter.sample_every, plain.sample_every);
  EXPECT_EQ(counter.card.max_constant_delay, plain.card.max_constant_delay);
  EXPECT_EQ(counter.axes_compensated, plain.axes_compensated);
}

TEST(ExampleConfig, ItsProbeShowsTheDefaults) {
  ASSERT_EQ(faults(with_counter_card_and_probe()), "");
  const auto probe = *parse_config(with_counter_card_and_probe(), "/etc/abbe/abbed.toml")
                          .value()
                          .of<ProbeConfig>();
  const ProbeConfig plain;

  EXPECT_EQ(probe.name, plain.name);
  EXPECT_EQ(probe.delay.id, plain.delay.id);
  EXPECT_EQ(probe.delay.delay, plain.delay.delay);
  EXPECT_EQ(probe.delay.u_jitter, plain.delay.u_jitter);
  EXPECT_EQ(probe.delay.u_delay, plain.delay.u_delay);
  EXPECT_EQ(probe.approach.max_speed_m_s, plain.approach.max_speed_m_s);
  EXPECT_EQ(probe.approach.max_speed_change, plain.approach.max_speed_change);
  EXPECT_EQ(probe.approach.speed_window, plain.approach.speed_window);
  EXPECT_EQ(probe.switching.confirm, plain.switching.confirm);
  EXPECT_EQ(probe.switching.chatter, plain.switching.chatter);
  EXPECT_EQ(probe.switching.rearm_quiet, plain.switching.rearm_quiet);
  EXPECT_EQ(probe.switching.rearm_retract_m, plain.switching.rearm_retract_m);
  EXPECT_EQ(probe.window_before, plain.window_before);
  EXPECT_EQ(probe.window_after, plain.window_after);
}

TEST(ExampleConfig, ItsCommentedKeysAreTheDefaults) {
  auto plain = parse_config(example(), "/etc/abbe/abbed.toml").value();
  use_dds_unit(plain.dds, plain.daemon.runtime_dir,
               true);  // the defaults of [dds] are those under abbed.service
  const auto full = parse_config(uncommented(), "/etc/abbe/abbed.toml").value();

  EXPECT_EQ(machine_hash(full), machine_hash(plain));
  EXPECT_EQ(full.machine, plain.machine);
  EXPECT_EQ(full.of<TrackerConfig>()->silence_timeout, plain.of<TrackerConfig>()->silence_timeout);
  EXPECT_EQ(full.of<TrackerConfig>()->weather, plain.of<TrackerConfig>()->weather);
  EXPECT_EQ(full.of<TrackerConfig>()->u_scale, plain.of<TrackerConfig>()->u_scale);
  EXPECT_EQ(full.of<TrackerConfig>()->reflector, plain.of<TrackerConfig>()->reflector);
  EXPECT_EQ(full.of<TrackerConfig>()->home_after_initialize,
            plain.of<TrackerConfig>()->home_after_initialize);
  EXPECT_EQ(full.of<EncoderConfig>()->u_sampling_delay,
            plain.of<EncoderConfig>()->u_sampling_delay);
  EXPECT_EQ(full.air.wavelength_m, plain.air.wavelength_m);
  EXPECT_EQ(full.air.co2_ppm, plain.air.co2_ppm);
  EXPECT_EQ(full.air.u_relative_humidity, plain.air.u_relative_humidity);
  EXPECT_EQ(full.air.max_age, plain.air.max_age);
  EXPECT_EQ(full.daemon.watermark, plain.daemon.watermark);
  EXPECT_EQ(full.daemon.data_dir, plain.daemon.data_dir);
  EXPECT_EQ(full.recording.dir, plain.recording.dir);
  EXPECT_EQ(full.recording.chunk_bytes, plain.recording.chunk_bytes);
  EXPECT_EQ(full.recording.min_free_bytes, plain.recording.min_free_bytes);
  EXPECT_EQ(full.dds.socket, plain.dds.socket);
  EXPECT_EQ(full.dds.supervise, plain.dds.supervise);
  EXPECT_EQ(full.dds.user, plain.dds.user);
  EXPECT_EQ(full.dds.validity, plain.dds.validity);
  EXPECT_EQ(full.gate.max_error_m, plain.gate.max_error_m);
  EXPECT_EQ(full.gate.max_gradient, plain.gate.max_gradient);
  EXPECT_EQ(full.control.socket, plain.control.socket);
  EXPECT_EQ(full.control.look_group, plain.control.look_group);
  EXPECT_EQ(full.control.change_group, plain.control.change_group);
  EXPECT_EQ(full.control.move_group, plain.control.move_group);
}

}  // namespace
}  // namespace abbe::daemon
