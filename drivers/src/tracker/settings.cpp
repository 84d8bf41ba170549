#include "abbe/drivers/tracker/settings.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <type_traits>
#include <variant>

#include "abbe/drivers/tracker/session.hpp"

namespace abbe::drivers {
namespace {

using emscon::Request;

/// Converts an answer that reports a setting to the request that sets the reported value; any other
/// answer gives nullopt.
struct SetterOf {
  std::optional<Request> operator()(const emscon::UnitsAnswer& a) const {
    return emscon::SetUnits{a.units};
  }
  std::optional<Request> operator()(const emscon::SystemSettingsAnswer& a) const {
    return emscon::SetSystemSettings{a.settings};
  }
  std::optional<Request> operator()(const emscon::EnvironmentAnswer& a) const {
    return emscon::SetEnvironmentParams{a.environment};
  }
  std::optional<Request> operator()(const emscon::ReflectorAnswer& a) const {
    return emscon::SetReflector{a.internal_id};
  }
  std::optional<Request> operator()(const emscon::LongSystemParameterAnswer& a) const {
    return emscon::SetLongSystemParameter{a.parameter, a.value};
  }
  template <class Set, emscon::Command kId>
  std::optional<Request> operator()(const emscon::SettingAnswer<Set, kId>& a) const {
    return a.set;
  }
  template <class Other>
  std::optional<Request> operator()(const Other&) const {
    return std::nullopt;
  }
};

bool same(const Request& a, const Request& b) {
  std::array<std::byte, emscon::kMaxRequestSize> bytes_a{}, bytes_b{};
  return emscon::encode(a, bytes_a) == emscon::encode(b, bytes_b) && bytes_a == bytes_b;
}

}  // namespace

/// Adds the settings in the order of restoring. Units are first, because each previous value is in
/// the previous units. The system settings are last, because they may disable messages that the
/// session needs.
TrackerSettings::TrackerSettings(const TrackerSessionOptions& options) {
  using emscon::MeasurementMode;
  const auto add = [this](const Request& question, const Request& wanted) {
    settings_.push_back({question, wanted});
  };

  add(emscon::GetUnits{}, emscon::SetUnits{});
  add(emscon::GetCoordinateSystemType{}, emscon::SetCoordinateSystemType{});
  add(emscon::GetStatisticMode{}, emscon::SetStatisticMode{});
  if (options.search) add(emscon::GetSearchParams{}, *options.search);

  switch (options.mode) {
    case TrackerMode::ContinuousTime:
      add(emscon::GetMeasurementMode{},
          emscon::SetMeasurementMode{MeasurementMode::ContinuousTime});
      add(emscon::GetContinuousTimeModeParams{},
          emscon::SetContinuousTimeModeParams{options.time_separation_ms});
      break;
    case TrackerMode::ContinuousDistance:
      add(emscon::GetMeasurementMode{},
          emscon::SetMeasurementMode{MeasurementMode::ContinuousDistance});
      add(emscon::GetContinuousDistanceModeParams{},
          emscon::SetContinuousDistanceModeParams{options.spatial_distance_mm});
      break;
    case TrackerMode::Stationary:
      add(emscon::GetMeasurementMode{}, emscon::SetMeasurementMode{MeasurementMode::Stationary});
      add(emscon::GetStationaryModeParams{},
          emscon::SetStationaryModeParams{options.stationary_time_ms, true});
      break;
  }

  if (options.mode != TrackerMode::Stationary) {
    constexpr auto kRate = emscon::LongParameter::TcpDataPacketRate;
    add(emscon::GetLongSystemParameter{kRate},
        emscon::SetLongSystemParameter{kRate, options.packets_per_second});
  }

  if (options.weather == emscon::WeatherMonitor::None)
    add(emscon::GetEnvironmentParams{}, emscon::SetEnvironmentParams{options.environment});
  emscon::SystemSettings system;
  system.weather_monitor = options.weather;
  add(emscon::GetSystemSettings{}, emscon::SetSystemSettings{system});
}

std::vector<Request> TrackerSettings::questions() const {
  std::vector<Request> out;
  for (const Setting& s : settings_)
    if (!s.asked) out.push_back(s.question);
  return out;
}

void TrackerSettings::found(const emscon::Answer& answer) {
  const auto setting = std::find_if(settings_.begin(), settings_.end(), [&](const Setting& s) {
    return emscon::command_of(s.question) == emscon::command_of(answer);
  });
  if (setting == settings_.end()) return;
  setting->asked = true;
  const auto value = std::visit(SetterOf{}, answer);
  if (!value || (setting->before && same(*value, adapted(*setting)))) return;
  setting->before = value;
}

void TrackerSettings::ask_again() noexcept {
  for (Setting& s : settings_) s.asked = false;
}

/// The wanted setting, with the previous values of the fields that abbe does not set.
Request TrackerSettings::adapted(const Setting& setting) {
  const auto* ours = std::get_if<emscon::SetSystemSettings>(&setting.wanted);
  const auto* before =
      setting.before ? std::get_if<emscon::SetSystemSettings>(&*setting.before) : nullptr;
  if (ours == nullptr || before == nullptr) return setting.wanted;
  emscon::SetSystemSettings adapted = *ours;
  adapted.settings.has_nivel = before->settings.has_nivel;
  adapted.settings.has_video_camera = before->settings.has_video_camera;
  return adapted;
}

std::optional<Request> TrackerSettings::wanted(emscon::Command command) const {
  for (const Setting& s : settings_)
    if (emscon::command_of(s.wanted) == command) return adapted(s);
  return std::nullopt;
}

std::vector<Request> TrackerSettings::restoring() const {
  std::vector<Request> out;
  for (const Setting& s : settings_)
    if (s.before && !same(*s.before, adapted(s))) out.push_back(*s.before);
  return out;
}

}  // namespace abbe::drivers
