#pragma once
/// Decides whether the axis readings still have the meaning that they had when a model was made.
/// All code that accepts or refuses a model because of the configuration calls these functions.
/// Pure.

#include <string>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The parts of the present configuration that determine the meaning of readings; smaller than the
/// Config itself.
struct PresentConfiguration {
  std::string hash;         ///< machine_hash()
  std::string former_hash;  ///< former_machine_hash()
  Meaning meaning;
};
[[nodiscard]] PresentConfiguration present_configuration(const Config& config);

struct ConfigurationFit {
  enum class Kind {
    Same,
    /// An earlier version of abbe made the model and did not know some of the present keys. The
    /// keys that it knew have the same values. A person may accept the model for the present
    /// configuration.
    OlderHash,
    Other,
  };
  Kind kind = Kind::Other;
  /// The reason why the model is not valid for this configuration, with the keys that differ;
  /// empty: it is valid.
  std::string sentence{};
};
[[nodiscard]] ConfigurationFit fit_of(const ModelDocument& document,
                                      const PresentConfiguration& present);

/// The reason why the model must not be applied with this configuration. Empty: it was made for
/// this configuration, or an earlier version of abbe made it and a person accepted it for this
/// configuration. `accepted_configuration`: the hash that its activation states.
[[nodiscard]] std::string unfit_for(const ModelDocument& document,
                                    const PresentConfiguration& present,
                                    const std::string& accepted_configuration);

/// The settings of measuring devices that have changed since the model was made: "[TABLE] KEY was
/// A, is B". Empty: none, or not known. A device that is not configured any more is not listed.
[[nodiscard]] std::string changed_measurements(const ModelDocument& document,
                                               const PresentConfiguration& present);

}  // namespace abbe::daemon
