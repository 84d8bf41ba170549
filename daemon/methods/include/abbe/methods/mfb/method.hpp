#pragma once
/// The interface of the method with a Multi-Feature Bar to the session, the replay and the control
/// API; see method_list.hpp.

#include <nlohmann/json_fwd.hpp>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/methods/identification_watch.hpp"
#include "abbe/methods/method_list.hpp"
#include "abbe/methods/mfb/acquisition.hpp"
#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

struct MfbMethod {
  static constexpr std::string_view kName = "mfb";
  using Request = MfbRequest;
  using Options = MfbAcquisitionOptions;
  using Acquisition = MfbAcquisition;
  using Run = MfbRun;
  using Candidate = MfbCandidate;

  /// Devices that the method reads. With a measuring machine no axis readings are needed, because
  /// it reports the position of each touch.
  [[nodiscard]] static MethodNeeds needs(const Config& config);
  [[nodiscard]] static Options options(const Config& config);
  /// Writes {"bar": {"file", "text"}, "plan": {"file", "text"}, "earlier_m": [[x, y, z] ..]}.
  [[nodiscard]] static nlohmann::json to_json(const Request& request);
  /// Reads the object that to_json() writes. "earlier_m" may be missing. Throws
  /// nlohmann::json::exception for another member that is missing, or for one of the wrong type.
  [[nodiscard]] static Request request_from(const nlohmann::json& object, const Config* config);
  /// Refused: there is no source of touches, the machine corrects its positions, or there are too
  /// few nodes. BadInput: bar, plan or earlier touches are invalid, or the plan does not determine
  /// all errors. The text names file and line, or the errors.
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
