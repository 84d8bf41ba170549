#pragma once
/// The interface of the ball array method to the session, the replay and the control API; see
/// method_list.hpp.

#include <nlohmann/json_fwd.hpp>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/methods/evemu/acquisition.hpp"
#include "abbe/methods/evemu/identification.hpp"
#include "abbe/methods/identification_watch.hpp"
#include "abbe/methods/method_list.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

struct EvemuMethod {
  static constexpr std::string_view kName = "evemu";
  using Request = EvemuRequest;
  using Options = EvemuAcquisitionOptions;
  using Acquisition = EvemuAcquisition;
  using Run = EvemuRun;
  using Candidate = EvemuCandidate;

  /// Whether the method needs axis readings. With a measuring machine it needs none, because the
  /// machine reports the position of each touch.
  [[nodiscard]] static MethodNeeds needs(const Config& config);
  [[nodiscard]] static Options options(const Config& config);
  [[nodiscard]] static nlohmann::json to_json(const Request& request);
  /// Members of the plan that `object` does not contain are taken from [evemu] of `config`; if
  /// `config` is null, they get their default values. Throws nlohmann::json::exception for a member
  /// that is missing or of the wrong type.
  [[nodiscard]] static Request request_from(const nlohmann::json& object, const Config* config);
  [[nodiscard]] static Result<void> check(const Request& request, const Config& config);
  [[nodiscard]] static Result<Acquisition> acquire(Request&& request, const Options& options);
  [[nodiscard]] static Run run_of(Acquisition&& acquisition);
  [[nodiscard]] static Result<Candidate> identify(const Run& run, const Config& config,
                                                  const calib::VolumetricModel* active,
                                                  const IdentificationWatch& watch);
  [[nodiscard]] static std::vector<InputFile> inputs_of(const Run& run);
  [[nodiscard]] static ModelDocument document_of(const Candidate& candidate, const Config& config,
                                                 std::vector<InputFile> inputs,
                                                 protocol::UtcTime created);
};

}  // namespace abbe::daemon
