#include "abbe/tasks/identify_again.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

std::string in_words(const calib::HeldOutFigures& held_out) {
  const auto& active = held_out.active_rms_m;
  return fmt::format("held-out residual rms {:.3f} um, without compensation {:.3f} um{}",
                     held_out.candidate_rms_m * kUmPerM, held_out.no_compensation_rms_m * kUmPerM,
                     active ? fmt::format(", active model {:.3f} um", *active * kUmPerM) : "");
}

IdentifiedAgain with_verdict(ModelDocument document, const calib::Verdict& verdict) {
  document.verdict = model_verdict(verdict);
  return {std::move(document), in_words(verdict.held_out)};
}

Result<IdentifiedAgain> identify(const IdentifyOtfArguments& arguments, const Progress& progress) {
  auto outcome = identify_otf_from(arguments, progress);
  ABBE_TRY(outcome);
  return with_verdict(std::move(outcome->document), outcome->verdict);
}

Result<IdentifiedAgain> identify(const IdentifyEvemuArguments& arguments,
                                 const Progress& progress) {
  auto outcome = identify_evemu(arguments, progress);
  ABBE_TRY(outcome);
  return with_verdict(std::move(outcome->document), outcome->candidate.verdict);
}

Result<IdentifiedAgain> identify(const IdentifyMfbArguments& arguments, const Progress& progress) {
  auto outcome = identify_mfb(arguments, progress);
  ABBE_TRY(outcome);
  return with_verdict(std::move(outcome->document), outcome->candidate.verdict);
}

}  // namespace

Result<IdentifiedAgain> identify_again(const AgainArguments& arguments, const Progress& progress) {
  return std::visit([&progress](const auto& of_method) { return identify(of_method, progress); },
                    arguments);
}

}  // namespace abbe::daemon
