#include "abbe/tasks/model_drift.hpp"

#include <array>
#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/same_machine.hpp"

namespace abbe::daemon {

Result<ModelDrift> model_drift(const ModelDriftArguments& arguments) {
  const auto a = found_model(arguments.a, arguments.store);
  ABBE_TRY(a);
  const auto b = found_model(arguments.b, arguments.store);
  ABBE_TRY(b);
  const std::array machines{of_machine(arguments.a, *a), of_machine(arguments.b, *b)};
  auto different = require_same_machine("model drift", machines, arguments.other_machine);
  ABBE_TRY(different);

  auto test = calib::test_drift(b->document.model, a->document.model,
                                {.false_alarm = arguments.false_alarm});
  if (!test) return tl::make_unexpected(error_of(test.error()));
  return ModelDrift{*std::move(test), machines[0].machine, machines[1].machine,
                    *std::move(different)};
}

}  // namespace abbe::daemon
