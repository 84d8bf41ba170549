#include "abbe/model/configuration_fit.hpp"

#include <fmt/format.h>

namespace abbe::daemon {
namespace {

using Kind = ConfigurationFit::Kind;

ConfigurationFit older_hash(const ModelDocument& document, const MeaningEntries& added) {
  return {Kind::OlderHash,
          fmt::format("the configuration hash of this model is of an earlier version and does not "
                      "contain {}: check that they are as they were when it was made, then: abbe "
                      "model activate {} --accept-older-hash --why REASON -c abbed.toml",
                      keys_text(added), model_id(document))};
}

ConfigurationFit other(std::string_view what) {
  return {Kind::Other,
          fmt::format("the model was made for another machine configuration: {}", what)};
}

}  // namespace

PresentConfiguration present_configuration(const Config& config) {
  return {machine_hash(config), former_machine_hash(config), config.meaning};
}

ConfigurationFit fit_of(const ModelDocument& document, const PresentConfiguration& present) {
  if (document.machine_hash == present.hash) return {Kind::Same};
  const auto& readings = present.meaning.readings;
  if (!document.configuration)
    return document.machine_hash == present.former_hash
               ? older_hash(document, not_in_former_hash(readings))
               : other("which keys differ is not known, because its file is of an earlier version");

  auto differing = difference(document.configuration->readings, readings);
  auto& changed = differing.changed;
  changed.insert(changed.begin(), differing.tables.begin(), differing.tables.end());
  if (!changed.empty()) return other(listed(changed));
  return differing.added.empty() ? other("the hash differs")
                                 : older_hash(document, differing.added);
}

std::string unfit_for(const ModelDocument& document, const PresentConfiguration& present,
                      const std::string& accepted_configuration) {
  const auto fit = fit_of(document, present);
  const bool accepted = fit.kind == Kind::OlderHash && accepted_configuration == present.hash;
  return accepted ? std::string{} : fit.sentence;
}

std::string changed_measurements(const ModelDocument& document,
                                 const PresentConfiguration& present) {
  if (!document.configuration) return {};
  return listed(
      difference(document.configuration->measurements, present.meaning.measurements).changed);
}

std::string_view devices_in_words(std::optional<bool> simulated) {
  if (!simulated) return "not known whether they were simulated: the file is of an earlier version";
  return *simulated ? "SIMULATED: the model describes no real machine" : "not simulated";
}

std::optional<bool> made_on_simulated_devices(const ModelDocument& document) {
  if (!document.configuration) return std::nullopt;
  const auto* simulated = value_of(document.configuration->readings, "daemon.simulated");
  const bool known = simulated != nullptr && (*simulated == "true" || *simulated == "false");
  return known ? std::optional{*simulated == "true"} : std::nullopt;
}

}  // namespace abbe::daemon
