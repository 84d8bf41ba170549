#include "abbe/methods/evemu/task_of_files.hpp"

#include <nlohmann/json.hpp>
#include <utility>

#include "abbe/methods/calibration_request.hpp"

namespace abbe::daemon {

nlohmann::json evemu_task(const CalibratorFile& calibrator, const BallErrorsFile* reference,
                          double u_reference_m) {
  EvemuRequest request;
  request.calibrator = calibrator.calibrator;
  request.sources = {calibrator.source};
  if (reference != nullptr) {
    request.rotation_reference = {reference->errors, u_reference_m};
    request.sources.push_back(reference->source);
  }

  nlohmann::json task = to_json(CalibrationTask{std::move(request)});
  for (const char* member : {"positions", "points_per_ball", "points_per_block"})
    task.erase(member);
  return task;
}

}  // namespace abbe::daemon
