#pragma once

#include "server/api/attention.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "server/metrics.h"

namespace joulecast::server {

// Exports the counters of diagnoses, the watch of the gap and adoptions, refreshed at each scrape.
void export_gap_metrics(Metrics& metrics, const DiagnosisService& diagnoses, const GapWatch& watch,
                        const ModelAdoption& adoption);

// Exports the number of entries of the attention list that are not acknowledged, by severity.
void export_attention_metrics(Metrics& metrics, const api::AttentionList& list);

}  // namespace joulecast::server
