#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/calib/mfb/judge/judge.hpp"
#include "abbe/calib/otf/observe/orientation.hpp"
#include "abbe/calib/otf/solve/other_beams.hpp"
#include "abbe/config/gate_conditions.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

void read_cpu(ClassifiedSection& section, Key key, std::optional<int>& out) {
  int cpu = 0;
  if (section.get_integer(key, cpu, 0, 1023)) out = cpu;
}

void read_scheduling(ClassifiedSection& section, DaemonConfig& out) {
  section.get_word<RealTimeMode>(
      operation("realtime"), out.realtime,
      {{"enforce", RealTimeMode::Enforce}, {"ignore", RealTimeMode::Ignore}});
  section.get_integer(operation("tracker_priority"), out.tracker_priority, 1, 99);
  section.get_integer(operation("encoder_priority"), out.encoder_priority, 1, 99);
  section.get_integer(operation("hub_priority"), out.hub_priority, 1, 99);

  if (out.hub_priority >= std::min(out.tracker_priority, out.encoder_priority))
    section.fault(
        "hub_priority",
        fmt::format("{} must be below tracker_priority {} and encoder_priority {}: otherwise a "
                    "busy hub delays the device threads",
                    out.hub_priority, out.tracker_priority, out.encoder_priority));
  read_cpu(section, operation("tracker_cpu"), out.tracker_cpu);
  read_cpu(section, operation("encoder_cpu"), out.encoder_cpu);
  read_cpu(section, operation("hub_cpu"), out.hub_cpu);
  if (int us = 0; section.get_integer(operation("cpu_latency_us"), us, 0, 10'000))
    out.cpu_latency = std::chrono::microseconds{us};
}

}  // namespace

void read_daemon(ClassifiedSection& root, const std::filesystem::path& base, Config& out) {
  ClassifiedSection section = root.child("daemon");
  auto& daemon = out.daemon;
  section.get(operation("data_dir"), daemon.data_dir, base);
  section.get(operation("runtime_dir"), daemon.runtime_dir, base);

  // The longest hub_period is half of the 100 ms between the alive messages that the hub sends to
  // abbe-dds, and far below the second without a cycle after which the hub counts as hung.
  section.get(operation("hub_period_us"), daemon.hub_period, kMicro, {50.0, 50e3});
  // Maximum: half of the time for which the assembler retains samples.
  section.get(operation("watermark_ms"), daemon.watermark, kMilli, {1.0, 5e3});
  section.get(reading("simulated"), daemon.simulated);
  section.get(reading("speed"), daemon.speed, kPlain, {1e-3, 1e4});
  if (daemon.speed != 1.0 && !daemon.simulated)
    section.fault("speed",
                  "may differ from 1 only with simulated = true: real devices run in real time");
  read_scheduling(section, daemon);
  section.close();
}

void read_recording(ClassifiedSection& root, const std::filesystem::path& base, Config& out) {
  Section section = root.operation_table("recording");
  auto& recording = out.recording;
  recording.dir = out.daemon.data_dir / "recordings";
  section.get("dir", recording.dir, base);
  std::uint32_t chunk_kB = 256;

  if (section.get_integer("chunk_kB", chunk_kB, 4, 65536)) recording.chunk_bytes = chunk_kB * 1024;
  section.get("chunk_period_ms", recording.chunk_period, kMilli, {10.0, 60e3});
  section.get("raw", recording.raw);
  std::uint64_t min_free_MB = 256;
  if (section.get_integer("min_free_MB", min_free_MB, 0, 1'000'000'000))
    recording.min_free_bytes = min_free_MB << 20;
  std::uint64_t max_file_MB = 0;
  if (section.get_integer("max_file_MB", max_file_MB, 0, 1'000'000'000))
    recording.max_file_bytes = max_file_MB << 20;
  int keep_days = 0;
  if (section.get_integer("keep_days", keep_days, 0, 36'500))
    recording.keep = std::chrono::days{keep_days};
  section.close();
}

void read_models(ClassifiedSection& root, ModelRetention& out) {
  Section section = root.operation_table("models");
  section.get_integer("keep_newest", out.keep_newest, 0, 1'000'000);
  int keep_days = 0;
  if (section.get_integer("keep_days", keep_days, 0, 36'500))
    out.keep = std::chrono::days{keep_days};
  if (keep_days > 0 && out.keep_newest == 0)
    section.fault("keep_days",
                  "needs keep_newest: a clock that is ahead makes every model old, so the newest "
                  "models are kept at any age");
  section.close();
}

void read_participant(ClassifiedSection& root, const std::filesystem::path& base, Config& out) {
  Section section = root.operation_table("dds");
  read_dds(section, base, out.daemon.runtime_dir, out.dds);
  if (out.dds.priority >= out.daemon.hub_priority)
    section.fault("priority",
                  fmt::format("must be below [daemon] hub_priority {}: otherwise a busy DDS "
                              "participant delays the hub",
                              out.daemon.hub_priority));
  section.close();
}

void read_gate(ClassifiedSection& root, Config& out) {
  Section section = root.operation_table("gate");
  auto& gate = out.gate;
  section.get("max_error_mm", gate.max_error_m, kMilli, kPositive);
  section.get("max_gradient", gate.max_gradient, kPlain, kPositive);
  section.get("path_tolerance_mm", gate.path_tolerance_m, kMilli, kPositive);
  section.get("holdout_fraction", gate.holdout_fraction, kPlain, {0.05, 0.5});

  if (section.get("accept", gate.accept)) {
    const auto known = gate_conditions();
    const auto others = known.first(known.size() - 1);
    for (const auto& name : gate.accept)
      if (std::ranges::find(known, name) == known.end())
        section.fault("accept", fmt::format("\"{}\": must be \"{}\" or \"{}\"", name,
                                            fmt::join(others, "\", \""), known.back()));
  }

  section.close();
}

void read_control(ClassifiedSection& root, const std::filesystem::path& base, Config& out) {
  Section section = root.operation_table("control");
  out.control.socket = out.daemon.runtime_dir / "control.sock";
  section.get("socket", out.control.socket, base);
  section.get_maybe_empty("look_group", out.control.look_group);
  section.get_maybe_empty("change_group", out.control.change_group);
  section.get_maybe_empty("move_group", out.control.move_group);
  section.close();
}

std::span<const std::string_view> gate_conditions() noexcept {
  static constexpr std::array kConditions{
      calib::evemu::kShapeOnly,     calib::kSmallerVolume,       calib::kScaleChange,
      calib::otf::kPathOrientation, calib::mfb::kBarTemperature, calib::mfb::kBarTemperatureChange,
      calib::otf::kOtherBeams};
  return kConditions;
}

bool GateConfig::accepts(std::string_view name) const {
  return std::find(accept.begin(), accept.end(), name) != accept.end();
}

}  // namespace abbe::daemon
