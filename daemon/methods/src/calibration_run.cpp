#include "abbe/methods/calibration_run.hpp"

#include <chrono>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::daemon {

Result<Candidate> identify(const CalibrationRun& run, const Config& config,
                           const calib::VolumetricModel* active, const IdentificationWatch& watch) {
  return Methods::visit(run, [&](auto method, const auto& of_method) -> Result<Candidate> {
    auto found = method.identify(of_method, config, active, watch);
    ABBE_TRY(found);
    return std::move(*found);
  });
}

std::vector<InputFile> inputs_of(const CalibrationRun& run) {
  return Methods::visit(
      run, [](auto method, const auto& of_method) { return method.inputs_of(of_method); });
}

std::string_view method_of(const Candidate& candidate) noexcept {
  return Methods::visit(candidate, [](auto method, const auto&) { return method.kName; });
}

const calib::Verdict& verdict_of(const Candidate& candidate) {
  return std::visit([](const auto& c) -> const calib::Verdict& { return c.verdict; }, candidate);
}

ModelDocument document_of(const Candidate& candidate, const Config& config,
                          std::vector<InputFile> inputs, protocol::UtcTime created) {
  return Methods::visit(candidate, [&](auto method, const auto& c) {
    return method.document_of(c, config, std::move(inputs), created);
  });
}

ObservedTimes observed(const CalibrationRun& run) {
  return std::visit([](const auto& of_method) { return of_method.observed; }, run);
}

void add_measured(ModelDocument& document, const ObservedTimes& times, protocol::UtcOffset utc) {
  if (!times || !document.run) return;
  auto& conditions = document.run->conditions;
  if (!conditions) conditions.emplace();
  const auto [first, last] = *times;
  conditions->measured = {utc.to_utc(first), utc.to_utc(last)};
  if (!conditions->duration_s)
    conditions->duration_s = std::chrono::duration<double>(last - first).count();
}

}  // namespace abbe::daemon
