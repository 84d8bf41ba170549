#pragma once
/// Whether the axis readings have the meaning that they had when a model was made. Everything that
/// decides on a model by the configuration asks here. Pure.

#include <string>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// What the present configuration means; smaller than the Config itself.
struct PresentConfiguration {
  std::string hash;         ///< machine_hash()
  std::string former_hash;  ///< former_machine_hash()
  Meaning meaning;
};
[[nodiscard]] PresentConfiguration present_configuration(const Config& config);

struct ConfigurationFit {
  enum class Kind {
    Same,
    /// The model is of an earlier version that did not know some of the present keys. What it knew
    /// is the same. A person may accept the model for the present configuration.
    OlderHash,
    Other,
  };
  Kind kind = Kind::Other;
  /// Why the model is not for this configuration, with the keys that differ; empty: it is.
  std::string sentence{};
};
[[nodiscard]] ConfigurationFit fit_of(const ModelDocument& document,
                                      const PresentConfiguration& present);

/// Why the model must not be applied to this configuration; empty: it is for it, or it is of an
/// earlier version and was accepted for it. `accepted_configuration`: that of its activation.
[[nodiscard]] std::string unfit_for(const ModelDocument& document,
                                    const PresentConfiguration& present,
                                    const std::string& accepted_configuration);

/// What was measured otherwise when the model was made: "[TABLE] KEY was A, is B". Empty:
/// nothing, or not known. A device that is not configured any more is not named.
[[nodiscard]] std::string changed_measurements(const ModelDocument& document,
                                               const PresentConfiguration& present);

}  // namespace abbe::daemon
