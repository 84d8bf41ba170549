#pragma once
/// Samples as lines of text, one each, for people and for golden recordings: time in ms from the
/// beginning of the recording, what is to be known about it by name, then the values. The same
/// samples give the same text.

#include <cstdio>

#include "abbe/pipeline/batch.hpp"

namespace abbe::daemon {

void print_samples(std::FILE* to, const Batch& batch, protocol::HostTime begin);

}  // namespace abbe::daemon
