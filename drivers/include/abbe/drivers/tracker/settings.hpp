#pragma once
/// The settings that abbe changes in a controller, and their previous values. Other programs use
/// the same controller. Therefore abbe reads each setting before it sets it, and restores the
/// settings that it changed. Not real-time.
///
/// abbe does not change the values of the transformation and the station orientation. It disables
/// their use in the system settings, and restores the system settings at the end. It does not
/// change the settings of Nivel and camera.

#include <optional>
#include <vector>

#include "abbe/protocol/emscon/answers.hpp"
#include "abbe/protocol/emscon/requests.hpp"

namespace abbe::drivers {

namespace emscon = protocol::emscon;

struct TrackerSessionOptions;

class TrackerSettings {
 public:
  explicit TrackerSettings(const TrackerSessionOptions& options);

  /// Queries to send before anything is set; empty when all were answered.
  [[nodiscard]] std::vector<emscon::Request> questions() const;
  /// Stores the answer to a query. A setting that the controller does not report is not restored.
  void found(const emscon::Answer& answer);
  /// Queries all settings again. Call it when the controller may have lost them. A value that abbe
  /// itself set does not replace the stored previous value.
  void ask_again() noexcept;

  /// The request that abbe sends with this command, based on the previous value; nullopt if abbe
  /// does not use the command.
  [[nodiscard]] std::optional<emscon::Request> wanted(emscon::Command command) const;
  /// Requests that restore every previous value that differs from the one abbe set, units first.
  [[nodiscard]] std::vector<emscon::Request> restoring() const;

 private:
  struct Setting {
    emscon::Request question;
    emscon::Request wanted;
    std::optional<emscon::Request> before{};  ///< previous value, in the previous units
    bool asked = false;
  };
  [[nodiscard]] static emscon::Request adapted(const Setting& setting);

  std::vector<Setting> settings_;
};

}  // namespace abbe::drivers
