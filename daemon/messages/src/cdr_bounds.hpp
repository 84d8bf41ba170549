#pragma once
/// Checks the bounds that abbe_v1.idl defines. One overload of visit() per type lists its bounded
/// members in the order of the IDL. The lists are written by hand because Fast CDR has neither
/// reflection nor bound checks; a test compares them with the text of the IDL.

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "abbe_v1.h"

namespace abbe::daemon::bounds {

template <class V>
void visit(const v1::TrackerPoint& m, V&& v) {
  v("device", m.device(), 32);
}
template <class V>
void visit(const v1::AxisSample& m, V&& v) {
  v("device", m.device(), 32);
  v("counts", m.counts(), 8);
  v("position", m.position(), 8);
}
template <class V>
void visit(const v1::ProbeTrigger& m, V&& v) {
  v("device", m.device(), 32);
  v("position", m.position(), 8);
  v("velocity", m.velocity(), 8);
  v("u_position", m.u_position(), 8);
  v("U95_position", m.U95_position(), 8);
}
template <class V>
void visit(const v1::TouchScan& m, V&& v) {
  v("device", m.device(), 32);
  v("counts", m.counts(), 8);
  v("position", m.position(), 8);
}
template <class V>
void visit(const v1::EnvironmentSample& m, V&& v) {
  v("device", m.device(), 32);
}
template <class V>
void visit(const v1::RawBytes& m, V&& v) {
  v("device", m.device(), 32);
  v("bytes", m.bytes(), 2048);
}
template <class V>
void visit(const v1::CalibrationEvent& m, V&& v) {
  v("machine", m.machine(), 64);
  v("method", m.method(), 16);
  v("state", m.state(), 16);
  v("reason", m.reason(), 512);
  v("model_id", m.model_id(), 64);
}
template <class V>
void visit(const v1::Snapshot& m, V&& v) {
  v("machine", m.machine(), 64);
  v("position", m.position(), 8);
  v("velocity", m.velocity(), 8);
  v("u_position", m.u_position(), 8);
}
template <class V>
void visit(const v1::Compensation& m, V&& v) {
  v("machine", m.machine(), 64);
  v("kind", m.kind());
  v("state", m.state());
  v("model_id", m.model_id(), 64);
}
template <class V>
void visit(const v1::Parameter& m, V&& v) {
  v("name", m.name(), 16);
}
template <class V>
void visit(const v1::AxisRange& m, V&& v) {
  v("axis", m.axis(), 8);
}
template <class V>
void visit(const v1::ErrorModel& m, V&& v) {
  v("machine", m.machine(), 64);
  v("model_id", m.model_id(), 64);
  v("method", m.method(), 16);
  v("estimator", m.estimator(), 32);
  v("gauge", m.gauge(), 32);
  v("chain", m.chain(), 64);
  v("basis", m.basis(), 16);
  v("squareness", m.squareness(), 16);
  v("parameters", m.parameters(), 1024);
  v("validity", m.validity(), 3);
  v("validity_hull", m.validity_hull(), 512);
  v("recording_sha256", m.recording_sha256(), 64);
}
template <class V>
void visit(const v1::HullVertex&, V&&) {}
template <class V>
void visit(const v1::GridNode&, V&&) {}
template <class V>
void visit(const v1::ErrorGrid& m, V&& v) {
  v("machine", m.machine(), 64);
  v("model_id", m.model_id(), 64);
  v("nodes", m.nodes(), 456);
}
template <class V>
void visit(const v1::ModelState& m, V&& v) {
  v("machine", m.machine(), 64);
  v("state", m.state());
  v("reason", m.reason(), 256);
  v("model_id", m.model_id(), 64);
}
template <class V>
void visit(const v1::Identity& m, V&& v) {
  v("machine", m.machine(), 64);
  v("machine_id", m.machine_id(), 36);
  v("twin_seen", m.twin_seen(), 256);
  v("model_id", m.model_id(), 64);
}
template <class V>
void visit(const v1::Health& m, V&& v) {
  v("machine", m.machine(), 64);
  v("stream", m.stream(), 32);
  v("state", m.state(), 24);
  v("fault", m.fault(), 256);
}

/// True for the structs of abbe_v1.idl that are elements of a sequence. The members of such an
/// element are checked as well.
template <class E>
inline constexpr bool kIsNested =
    std::is_same_v<E, v1::Parameter> || std::is_same_v<E, v1::AxisRange> ||
    std::is_same_v<E, v1::HullVertex> || std::is_same_v<E, v1::GridNode>;

/// A visitor that checks the bounds of one value. After visit(), `broken` describes the first bound
/// that is violated; it is empty if there is none.
class Checker {
 public:
  std::string broken;

  void operator()(std::string_view member, const std::string& text, std::size_t bound) {
    if (text.size() > bound) report(member, std::to_string(text.size()) + " bytes", bound);
    // A CDR string ends at its first NUL: the characters after it would be lost.
    if (text.find('\0') != std::string::npos) report(member, "contains a NUL");
  }

  template <class E>
  void operator()(std::string_view member, const std::vector<E>& elements, std::size_t bound) {
    if (elements.size() > bound)
      report(member, std::to_string(elements.size()) + " elements", bound);
    if constexpr (kIsNested<E>) {
      for (const E& e : elements) visit(e, *this);
    }
  }

  void operator()(std::string_view member, v1::ModelStatus s) {
    if (s > v1::MODEL_INVALID) report(member, "not an enumerator");
  }
  void operator()(std::string_view member, v1::Quantity q) {
    if (q > v1::QUANTITY_COMMAND_CORRECTION) report(member, "not an enumerator");
  }

 private:
  void report(std::string_view member, const std::string& seen, std::size_t bound) {
    report(member, seen + ", bound " + std::to_string(bound));
  }
  void report(std::string_view member, const std::string& seen) {
    if (broken.empty()) broken = std::string(member) + ": " + seen;
  }
};

}  // namespace abbe::daemon::bounds
