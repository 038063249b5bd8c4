// Short names of the generated wire types.
import type { components } from "./schema";

type Schemas = components["schemas"];
export type ApiKey = Schemas["ApiKey"];
export type AppearanceReport = Schemas["AppearanceReport"];
export type Belief = Schemas["Belief"];
export type AuditEntry = Schemas["AuditEntry"];
export type BestObject = Schemas["BestObject"];
export type Catalogue = Schemas["Catalogue"];
export type CatalogueVersion = Schemas["CatalogueVersion"];
export type CloseSession = Schemas["CloseSession"];
export type Explanation = Schemas["Explanation"];
export type Fleet = Schemas["Fleet"];
export type FleetSession = Schemas["FleetSession"];
export type FleetChanged = Schemas["FleetChanged"];
export type TracePoint = Schemas["TracePoint"];
export type InterestMap = Schemas["InterestMap"];
export type InterestPlace = Schemas["InterestPlace"];
export type Forwarding = Schemas["Forwarding"];
export type Job = Schemas["Job"];
export type MapPatch = Schemas["MapPatch"];
export type MeshFormat = Schemas["MeshFormat"];
export type MeshReport = Schemas["MeshReport"];
export type MeshUnit = Schemas["MeshUnit"];
export type NewApiKey = Schemas["NewApiKey"];
export type NextTouch = Schemas["NextTouch"];
export type NextTouches = Schemas["NextTouches"];
export type ObjectInfo = Schemas["ObjectInfo"];
export type ObjectMap = Schemas["ObjectMap"];
export type OccupancyMap = Schemas["OccupancyMap"];
export type Pose = Schemas["Pose"];
export type PoseHypothesis = Schemas["PoseHypothesis"];
export type Problem = Schemas["Problem"];
export type Readiness = Schemas["Readiness"];
export type ReadingContribution = Schemas["ReadingContribution"];
export type Replay = Schemas["Replay"];
export type ReplayStep = Schemas["ReplayStep"];
export type Role = Schemas["Role"];
export type Sensor = Schemas["Sensor"];
export type SensorCalibration = Schemas["SensorCalibration"];
export type SensorHealth = Schemas["SensorHealth"];
export type SensorPassport = Schemas["SensorPassport"];
export type Commissioning = Schemas["Commissioning"];
export type ReferenceBodies = Schemas["ReferenceBodies"];
export type Session = Schemas["Session"];
export type SessionEvent = Schemas["SessionEvent"];
export type SessionReading = Schemas["SessionReading"];
export type ShadowAnswer = Schemas["ShadowAnswer"];
export type ShadowReport = Schemas["ShadowReport"];
export type StartTraining = Schemas["StartTraining"];
export type Storage = Schemas["Storage"];
export type StoredReading = Schemas["StoredReading"];
export type Truth = Schemas["Truth"];
export type Version = Schemas["ServerVersion"];
export type Webhook = Schemas["Webhook"];
export type WebhookDelivery = Schemas["WebhookDelivery"];
export type WebhookEventType = Schemas["WebhookEventType"];
export type NewWebhook = Schemas["NewWebhook"];
export type Whoami = Schemas["Whoami"];

/** A page of a list. */
export interface Page<T> {
  items: T[];
  next_cursor?: string | null;
}
