#pragma once
/// The messages feeder and tests agree on: the feeder publishes them, the tests compare what a
/// subscriber prints.

#include <string>
#include <vector>

#include "abbe/messages/cdr.hpp"

namespace abbe::test {

inline constexpr const char* kMachine = "vmc-3";
inline constexpr const char* kModelId = "otf-2024-06-01";

inline v1::ModelState active_state(std::uint64_t sequence) {
  v1::ModelState s;
  s.machine(kMachine);
  s.sequence_number(sequence);
  s.host_time_ns(1'234'567'890'123LL);
  s.state(v1::MODEL_ACTIVE);
  s.reason("gate passed");
  s.model_id(kModelId);
  s.age_ns(5'000'000'000LL);
  s.validity_ns(500'000'000LL);
  return s;
}

inline constexpr const char* kMachineId = "7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11";

inline v1::Identity identity(std::uint64_t sequence) {
  v1::Identity m;
  m.machine(kMachine);
  m.sequence_number(sequence);
  m.machine_id(kMachineId);
  m.model_id(kModelId);
  return m;
}

inline v1::ErrorModel error_model() {
  v1::ErrorModel m;
  m.machine(kMachine);
  m.sequence_number(3);
  m.model_id(kModelId);
  m.method("otf");
  m.estimator("two-step");
  m.gauge("G1");
  m.chain("[w X' b Y Z (C1) t]");
  m.basis("linear");
  m.squareness("travel");
  m.tool_offset_m({0.0, 0.0, -0.1});

  for (int i = 0; i < 300; ++i) {
    v1::Parameter p;
    p.name(i % 2 == 0 ? "EXX" : "EA0Z");
    p.position_m(0.025 * i);
    p.value(1e-6 * i - 1e-4);
    p.u(1e-7 + 1e-9 * i);
    m.parameters().push_back(p);
  }

  v1::AxisRange x;
  x.axis("X");
  x.min_m(-0.25);
  x.max_m(0.5);
  m.validity({x});

  for (const double z : {0.0, 0.25, 0.5}) {
    v1::HullVertex vertex;
    vertex.position_m({-0.25, 0.125, z});
    m.validity_hull().push_back(vertex);
  }

  m.recording_sha256(std::string(64, 'a'));
  m.created_utc_ns(1'717'200'000'000'000'000LL);
  return m;
}

inline constexpr std::size_t kNodesPerAxis = 9;

/// V at a point of the sample grid, linear in every coordinate so that interpolation is exact.
inline std::array<double, 3> error_at(const std::array<double, 3>& p) {
  return {1e-5 + 4e-5 * p[0], -2e-5 + 3e-5 * p[1] * p[0], 1e-5 * p[2]};
}

/// 9 x 9 x 9 nodes, 0.1 m apart, in two slices.
inline std::vector<v1::ErrorGrid> grid_slices() {
  std::vector<v1::ErrorGrid> slices(2);
  for (std::size_t i = 0; i < kNodesPerAxis * kNodesPerAxis * kNodesPerAxis; ++i) {
    v1::GridNode node;
    node.position_m({0.1 * static_cast<double>(i / (kNodesPerAxis * kNodesPerAxis)),
                     0.1 * static_cast<double>(i / kNodesPerAxis % kNodesPerAxis),
                     0.1 * static_cast<double>(i % kNodesPerAxis)});
    node.error_m(error_at(node.position_m()));
    node.cov_m2({1e-12, 0.0, 0.0, 4e-12, 0.0, 9e-12});
    node.inside(i != 500);  // one in slice 1
    slices[i / 456].nodes().push_back(node);
  }

  for (std::uint32_t s = 0; s < 2; ++s) {
    slices[s].machine(kMachine);
    slices[s].slice(s);
    slices[s].slices(2);
    slices[s].sequence_number(4);
    slices[s].model_id(kModelId);
    slices[s].every_node(true);
  }

  return slices;
}

inline v1::Snapshot snapshot(std::uint64_t sequence) {
  v1::Snapshot s;
  s.machine(kMachine);
  s.sequence_number(sequence);
  s.position({0.1, 0.2, 0.3});
  s.velocity({0.0, 0.0, 0.01});
  s.u_position({1e-7, 1e-7, 1e-7});
  return s;
}

inline v1::Compensation compensation(std::uint64_t sequence) {
  v1::Compensation c;
  c.machine(kMachine);
  c.sequence_number(sequence);
  c.state(v1::MODEL_ACTIVE);
  c.inside(true);
  c.tool_ok(true);
  c.vector_m({1e-6, -2e-6, 3e-6});
  c.model_id(kModelId);
  c.age_ns(1'000'000);
  c.validity_ns(500'000'000);
  return c;
}

}  // namespace abbe::test
