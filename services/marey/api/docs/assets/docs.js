"use strict";
SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#docs",
  deepLinking: true,
  defaultModelsExpandDepth: 0,
  docExpansion: "list",
  displayRequestDuration: true,
  filter: true,
  persistAuthorization: false, // a key stays on this page alone
  tryItOutEnabled: false,
  validatorUrl: null, // else the document's address goes to a server on the internet
  onComplete: () => (document.body.dataset.ready = "yes"),
});
