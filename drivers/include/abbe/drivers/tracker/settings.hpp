#pragma once
/// What abbe sets in a controller, and what stood there before: other programs use the same
/// controller, so abbe asks before it sets and puts back what it changed. Ordinary world.
///
/// The transformation and the station orientation keep their values: abbe switches their use off in
/// the system settings, and on again at the end. Nivel and camera stay as they are.

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

  /// Questions that are still to be asked before anything is set, none once they were.
  [[nodiscard]] std::vector<emscon::Request> questions() const;
  /// An answer to one of them. What the controller does not tell is not put back.
  void found(const emscon::Answer& answer);
  /// The controller may have forgotten what was set: asks anew. A value that abbe itself set is not
  /// taken for what stood there before.
  void ask_again() noexcept;

  /// What abbe sets with this command, given what was found; none if it does not use it.
  [[nodiscard]] std::optional<emscon::Request> wanted(emscon::Command command) const;
  /// Puts back whatever was found otherwise than wanted, units first.
  [[nodiscard]] std::vector<emscon::Request> restoring() const;

 private:
  struct Setting {
    emscon::Request question;
    emscon::Request wanted;
    std::optional<emscon::Request> before{};  ///< as found, in the units found
    bool asked = false;
  };
  [[nodiscard]] static emscon::Request adapted(const Setting& setting);

  std::vector<Setting> settings_;
};

}  // namespace abbe::drivers
