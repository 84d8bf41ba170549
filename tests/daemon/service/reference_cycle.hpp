#pragma once
/// One cycle of a pipeline in which only the reference service observes.

#include "abbe/pipeline/pipeline.hpp"
#include "abbe/service/reference_service.hpp"

namespace abbe::daemon {

inline void give(ReferenceService& service, Batch& batch) {
  Pipeline pipeline{{}, &service.zeros()};
  pipeline.add(service);
  pipeline.cycle(batch);
}

}  // namespace abbe::daemon
