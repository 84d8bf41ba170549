#include "abbe/methods/calibration_run.hpp"

#include <utility>

#include "abbe/base/sha256.hpp"

namespace abbe::daemon {
namespace {

std::string touches_sha256(std::span<const calib::evemu::Touch> touches) {
  Sha256 hash;
  for (const auto& t : touches) {
    hash.update_bytes_of(t.position);
    hash.update_bytes_of(t.feature);
    hash.update_bytes_of(t.number);
    for (const double p_m : t.p_m) hash.update_bytes_of(p_m);
  }
  return hash.hex();
}

}  // namespace

Result<Candidate> identify(const CalibrationRun& run, const Config& config,
                           const calib::VolumetricModel* active, const IdentificationWatch& watch) {
  if (const auto* otf = std::get_if<OtfRun>(&run)) {
    auto found = identify_run(*otf, config.machine, config.gate, active, watch);
    if (!found) return tl::unexpected(found.error());
    return std::move(*found);
  }
  auto found = identify_touches(std::get<EvemuRun>(run), config, active, watch.stopped);
  if (!found) return tl::unexpected(found.error());
  return std::move(*found);
}

std::vector<InputFile> inputs_of(const CalibrationRun& run) {
  if (const auto* otf = std::get_if<OtfRun>(&run)) return {{"points", points_sha256(otf->points)}};
  const auto& evemu = std::get<EvemuRun>(run);
  std::vector<InputFile> inputs = evemu.asked.sources;
  inputs.push_back({"touches", touches_sha256(evemu.touches)});
  return inputs;
}

std::string_view method_of(const Candidate& candidate) noexcept {
  return std::holds_alternative<OtfCandidate>(candidate) ? "otf" : "evemu";
}

const calib::VolumetricModel& model_of(const Candidate& candidate) {
  return std::visit([](const auto& c) -> const calib::VolumetricModel& { return c.solution.model; },
                    candidate);
}

const calib::Verdict& verdict_of(const Candidate& candidate) {
  return std::visit([](const auto& c) -> const calib::Verdict& { return c.verdict; }, candidate);
}

ModelDocument document_of(const Candidate& candidate, const Config& config,
                          std::vector<InputFile> inputs, protocol::UtcTime created) {
  if (const auto* otf = std::get_if<OtfCandidate>(&candidate))
    return otf_document(otf->solution, config, std::move(inputs), created);
  return evemu_document(std::get<EvemuCandidate>(candidate).solution, config, std::move(inputs),
                        created);
}

}  // namespace abbe::daemon
